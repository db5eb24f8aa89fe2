"""A wave calibration rehearsed end to end: the measured sea is the requested sea."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from rehearsing import rehearse, write_campaign

from rig.analysis.report import write_products
from rig.execution.task import RunResult
from rig.realtime.safety import Mode
from rig.realtime.sequence import NO_ROW, Phase
from rig.recording.runs import open_run

SEA = {"kind": "pink", "hm0_m": 0.05, "repeat_s": 10, "seed": 5, "realisation": 2}


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> RunResult:
    folder = tmp_path_factory.mktemp("calibration")
    keys: dict[str, Any] = {
        "sea": SEA,
        "device": "absent",
        "start": {"lead_in_s": 12},  # beyond the onset of the waves
        "timing": {"periods": 3},
    }
    return rehearse(write_campaign(folder, **keys), folder / "runs")


def test_the_run_ends_as_planned_with_all_power_off(result: RunResult) -> None:
    assert (result.outcome.status, result.outcome.reason) == ("complete", "PLAN_END")
    data = open_run(result.folder)
    assert set(np.unique(data["plan.row"])) == {NO_ROW}
    assert set(np.unique(data["safety.mode"])) <= {Mode.OFF, Mode.STOP_0}
    for field in ("heave.command.enable", "heave.command.current", "heave.command.force"):
        assert not data[field].values.any(), field
    phases, counts = np.unique(data["plan.phase"], return_counts=True)
    ticks = dict(zip(phases.tolist(), counts.tolist(), strict=True))
    assert (ticks[Phase.LEAD_IN], ticks[Phase.MEASURE]) == (12_000, 30_000)
    assert set(ticks) == {Phase.LEAD_IN, Phase.MEASURE, Phase.DONE}
    assert data["plan.wave_clock"].values[0] == 0.0


def test_the_stator_does_not_move(result: RunResult) -> None:
    data = open_run(result.folder, ["spring_command", "spring_sense"])
    assert not data["spring_command.enable"].values.any()
    assert np.ptp(data["spring_sense.position"].values) == 0.0


def test_the_measured_sea_is_the_requested_one(result: RunResult) -> None:
    """Amplitudes agree to 1e-9; the sense is one tick old, which is a phase of 2 pi f 1 ms."""
    products = {path.name: path for path in write_products(result.folder)}
    with xarray.open_dataset(products["wave_calibration.nc"]) as table:
        truth = table.sel(probe="elevation")
        np.testing.assert_allclose(truth["amplitude"], table["commanded_amplitude"], rtol=1e-9)
        late = (table["commanded_phase"] - truth["phase"]) / (2.0 * np.pi * table["frequency"])
        np.testing.assert_allclose(late, 0.001, atol=1e-9)
        assert float(truth["hm0"]) == pytest.approx(0.05, rel=1e-9)
        assert table.attrs["hm0_asked_m"] == pytest.approx(0.05, rel=1e-9)
        assert int(truth["periods"]) == 3
        assert table["cycles"].values.tolist() == list(range(2, 11))
    assert "target of 50.0 mm" in products["summary.txt"].read_text()


def test_another_realisation_is_another_wave_of_the_same_spectrum(
    result: RunResult, tmp_path: Path
) -> None:
    keys: dict[str, Any] = {
        "sea": SEA | {"realisation": 3},
        "device": "absent",
        "start": {"lead_in_s": 12},
        "timing": {"periods": 1},
    }
    other = rehearse(write_campaign(tmp_path, **keys), tmp_path / "runs")
    one, two = (
        open_run(folder, ["wave.elevation", "plan.phase"])
        for folder in (result.folder, other.folder)
    )
    waves = [
        data["wave.elevation"].values[data["plan.phase"].values == Phase.MEASURE][:10_000]
        for data in (one, two)
    ]
    np.testing.assert_allclose(*(np.abs(np.fft.rfft(wave))[2:11] for wave in waves), rtol=1e-9)
    assert np.abs(waves[0] - waves[1]).max() > 0.01
