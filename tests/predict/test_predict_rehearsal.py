"""Predictions against the same campaigns on the nonlinear plant.

Rows come from the compiled loop. Surge is not in the row table; it comes from a rehearsal's log.

Tolerances: peaks 1.5 % (a rehearsal adds estimator noise of a few mm/s), rms 0.5 %,
mechanical and AC power 0.5 % of the power at the load cell, DC power 0.5 W.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from predicting import SOFT, STIFF, custom_rig, predict_campaign, rows, simulate, write_campaign
from rehearsing import rehearse

from rig.realtime.sequence import Phase
from rig.recording.runs import open_run

PEAKS = ("position_peak", "stroke", "velocity_peak", "force_peak", "current_peak")
RMS = ("position_rms", "force_rms", "current_rms")
MECHANICAL = ("power_mechanical_1", "power_mechanical_2", "power_ac")

REGULAR = rows(
    (STIFF, -1000.0, 0.0),
    (STIFF, -2000.0, 8000.0),
    (STIFF, -3500.0, 10000.0),
    (SOFT, -1000.0, 4000.0),
    (SOFT, -2500.0, -2000.0),
)
IRREGULAR = rows((STIFF, -1500.0, 4000.0), (SOFT, -1000.0, 2000.0), (SOFT, -3000.0, 0.0))


def compare(path: Path, record: Callable[[str, object], None]) -> None:
    """Compare simulation and prediction; record the largest deviations in the test report."""
    forecast = predict_campaign(path)
    assert forecast.refused == ()
    table = simulate(path)
    predictions = [one.predicted for one in forecast.rows]
    assert table["state"].values.tolist() == ["complete"] * len(predictions)

    def error(name: str) -> Any:
        return np.array([getattr(one, name) for one in predictions]) - table[name].values

    for names, share in ((PEAKS, 0.015), (RMS, 0.005)):
        for name in names:
            worst = float(np.max(np.abs(error(name) / table[name].values)))
            record(name, worst)
            assert worst <= share, (name, worst)
    mechanical_power = np.abs(table["power_mechanical_1"].values)
    for name in MECHANICAL:
        worst = float(np.max(np.abs(error(name)) / mechanical_power))
        record(name, worst)
        assert worst <= 0.005, (name, worst)
    worst = float(np.max(np.abs(error("power_dc"))))
    record("power_dc", worst)
    assert worst <= 0.5
    assert worst > 0.0  # bitwise equality would mean a comparison with itself


@pytest.mark.parametrize("plant", ["wavebot", "wavebot_as_measured"])
def test_regular_rows(
    plant: str, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    """The forces of the plant as measured lag, which moves mechanical power by up to 8 W."""
    path = write_campaign(
        tmp_path,
        plant=plant,
        sea={"kind": "regular", "amplitude_m": 0.127, "frequency_hz": 0.5},
        start={"lead_in_s": 30},
        timing={"settle_s": 10, "interval_s": 16},
        matrix=REGULAR,
    )
    compare(path, record_property)


def test_irregular_rows(tmp_path: Path, record_property: Callable[[str, object], None]) -> None:
    path = write_campaign(
        tmp_path,
        sea={"kind": "jonswap", "hs_m": 0.2, "tp_s": 2.5, "repeat_s": 60, "seed": 5},
        start={"lead_in_s": 30},
        matrix=IRREGULAR,
    )
    compare(path, record_property)


def test_rows_of_the_custom_drive(
    tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    """Bus at 40 V and at 75 V, and a drive that is off at low velocity."""
    gains = (-8508.0, -2500.0, 3000.0)
    matrix = rows(gains, bus_voltage_v=75.0, velocity_threshold_m_per_s=0.0)
    matrix["list"] += rows(gains, bus_voltage_v=40.0, velocity_threshold_m_per_s=0.0)["list"]
    matrix["list"] += rows(gains, bus_voltage_v=75.0, velocity_threshold_m_per_s=0.05)["list"]
    path = write_campaign(
        tmp_path,
        rig=str(custom_rig(tmp_path)),
        sea={"kind": "regular", "amplitude_m": 0.0635, "frequency_hz": 0.4},
        start={"lead_in_s": 30},
        timing={"settle_s": 10, "interval_s": 22},
        matrix=matrix,
    )
    compare(path, record_property)
    predicted = predict_campaign(path).rows[1].predicted
    assert predicted.voltage_available is not None
    assert predicted.voltage_available < 0.707 * 46.0


@pytest.mark.parametrize("waves", [True, False], ids=["in waves", "in calm water"])
def test_rows_with_a_reference(
    waves: bool, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    """An open-loop multisine of 12 s with feedback and waves of 20 s: a common period of 60 s."""
    matrix = rows((STIFF, -1500.0, 2000.0), reference_scale=1.0)
    matrix["list"] += rows((STIFF, -1500.0, 2000.0), reference_scale=-0.5)["list"]
    sea = {"kind": "jonswap", "hs_m": 0.1, "tp_s": 2.5, "repeat_s": 20, "seed": 2}
    timing = {"settle_s": 10, "interval_s": 70}
    path = write_campaign(
        tmp_path,
        sea=sea if waves else {"kind": "calm"},
        start={"lead_in_s": 30},
        timing=timing if waves else {"settle_s": 10, "interval_s": 34},
        reference={"kind": "multisine", "amplitude_a": 10, "repeat_s": 12, "draws": 3},
        matrix=matrix,
    )
    compare(path, record_property)


def test_surge(tmp_path: Path) -> None:
    """Surge of a rehearsal, from its log: position, force and velocity within 2 %."""
    path = write_campaign(
        tmp_path,
        sea={"kind": "regular", "amplitude_m": 0.1, "frequency_hz": 0.5},
        tare={"duration_s": 1},
        start={"set_point_s": 1, "lead_in_s": 30},
        timing={"settle_s": 6, "interval_s": 12},
        matrix=rows((STIFF, -2000.0, 0.0)),
    )
    predicted = predict_campaign(path).rows[0].predicted
    result = rehearse(path, tmp_path / "runs")
    fields = ["surge.estimate.position", "surge.demand.force", "surge.estimate.velocity"]
    data = open_run(result.folder, fields=[*fields, "plan.phase"], rows=[0])
    measured = data.isel(time=np.flatnonzero(data["plan.phase"].values == int(Phase.MEASURE)))
    for field, value in zip(
        fields,
        (predicted.surge_position_peak, predicted.surge_force_peak, predicted.surge_velocity_peak),
        strict=True,
    ):
        assert float(np.abs(measured[field]).max()) == pytest.approx(value, rel=0.02), field
