"""Data-quality columns of the row table against known ticks."""

from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

import numpy as np
import pytest
import synthetic_runs as synthetic
from synthetic_runs import Row, Shape

from rig.analysis.report import analyse
from rig.analysis.rows import row_table
from rig.kinds.wavebot.row_contents import CHECKS
from rig.kinds.wavebot.tick import WaveBotRow
from rig.realtime.sequence import Phase
from rig.recording import row_layout
from rig.recording.runs.mcap_file import row_dtype

POWER = dict.fromkeys(("mechanical_1", "mechanical_2", "ac", "dc"), -10.0)
ROWS = [Row(i, 0, 490.9, -2000.0, 1000.0 * i, POWER) for i in range(2)]
SHAPE = Shape()


def filled() -> Any:
    """Return a run whose first row has known checks; values outside the windows are invalid."""
    data = synthetic.run_rows(ROWS, SHAPE)
    outside = data["plan.phase"] != Phase.MEASURE
    here = np.flatnonzero((data["plan.row"] == 0) & ~outside)
    n = len(here)
    turn = 2.0 * np.pi * np.arange(n) / n
    data["load.stator_a"][here] = -200.0 + 50.0 * np.sin(turn)
    data["load.stator_b"][here] = -100.0 - 20.0 * np.sin(turn)
    data["tare.stator_a"], data["tare.stator_b"] = -150.0, -80.0
    data["load.slew"][here] = 7.0 + np.sin(turn)
    data["tare.slew"] = 2.0
    data["load.lcb"][here] = np.linspace(-100.0, 100.0, n) + 12.0
    data["tare.lcb"] = 12.0
    data["load.trs"][here] = np.linspace(-50.0, 150.0, n)
    data["heave.estimate.velocity"][here] = np.linspace(-1.0, 1.0, n)
    data["power_sense.bus_voltage"][here] = 75.0 + np.sin(turn)
    data["drive_sense.saturated"][here[: n // 10]] = 1
    data["drive_command.conducting"] = 1
    data["drive_command.conducting"][here[: n // 4]] = 0
    data["drive_sense.dump"][here[: n // 5]] = 15
    data["surge.estimate.position"][here] = 0.004 + 0.03 * np.sin(turn)
    data["surge.command.force"][here] = 200.0 * np.sin(turn)
    for field in ("load.stator_a", "load.slew", "power_sense.bus_voltage", "surge.command.force"):
        data[field][outside] = 1e6
    return data


def write(folder: Path, data: Any, **more: Any) -> Path:
    return synthetic.write_run(folder, data, synthetic.plan_json(ROWS, SHAPE), **more)


def test_each_column_agrees_with_the_ticks(tmp_path: Path) -> None:
    row = row_table(write(tmp_path, filled())).isel(row=0)
    expected = {
        "stator_force_min": -330.0,  # -300 and a swing of 30, as recorded
        "slew_force_mean": 5.0,
        "lcb_p02": -96.0,
        "lcb_p98": 96.0,
        "trs_p01": -48.0,
        "trs_p98": 146.0,
        "velocity_p01": -0.98,
        "velocity_p98": 0.96,
        "bus_voltage_mean": 75.0,
        "share_saturated": 0.1,
        "share_gated": 0.25,
        "share_dump_on": 0.2,
        "surge_position_mean": 0.004,
        "surge_stroke": 0.06,
        "surge_force_rms": 200.0 / np.sqrt(2.0),
    }
    assert set(expected) == {check.name for check in CHECKS}
    units = {check.name: check.unit for check in CHECKS}
    for name, value in expected.items():
        assert float(row[name]) == pytest.approx(value, rel=2e-3, abs=1e-9), name
        assert row[name].attrs["units"] == units[name]


def test_a_mean_surge_position_raises_its_own_alarm(tmp_path: Path) -> None:
    data = filled()
    data["surge.estimate.position"][data["plan.row"] == 1] = -0.0093
    run = write(tmp_path, data)
    table = row_table(run)
    assert table["surge_position_alarm"].values.tolist() == [0, 1]
    assert table["position_alarm"].values.tolist() == [0, 0]
    (alarm,) = (text for text in analyse(run).summary.alarms if "surge" in text)
    assert alarm.startswith("mean surge position beyond 5 mm in row 1: −9.3 mm in row 1")


def position_alarm(folder: Path, means: tuple[float, float], amplitude: float) -> str:
    """Return the heave alarm of two rows whose motion has these means and an amplitude, m."""
    data = filled()
    turn = 0.02 * np.arange(len(data))
    offset = np.where(data["plan.row"] == 1, means[1], means[0])
    data["heave.estimate.position"] = offset + amplitude * np.sin(turn)
    (alarm,) = (text for text in analyse(write(folder, data)).summary.alarms if "mean pos" in text)
    return alarm


@pytest.mark.parametrize(
    ("means", "amplitude", "cause"),
    [
        ((0.009, 0.009), 0.1, "; check the encoder zero"),
        ((0.0, 0.02), 0.1, "; not all rows have it, so look for a drift or a steady force, "),
        ((0.25, 0.25), 0.001, "; it does not reach its zero: look for a Ki above the static "),
        ((0.0, -0.25), 0.02, "; it does not reach its zero: look for a Ki above the static "),
    ],
)
def test_the_alarm_of_a_mean_position_names_what_may_cause_it(
    means: tuple[float, float], amplitude: float, cause: str, tmp_path: Path
) -> None:
    """A wrong zero shifts all rows; a body at an end stop does not pass its zero."""
    assert cause in position_alarm(tmp_path, means, amplitude)


def test_old_run_without_surge_and_drive_fields(tmp_path: Path) -> None:
    now = get_type_hints(WaveBotRow, include_extras=True)
    gone = ("surge", "drive_sense", "drive_command", "reference")
    then = {name: hint for name, hint in now.items() if name not in gone}
    row_type = NamedTuple("WaveBotRow", list(then.items()))
    data = filled()
    dtype = row_dtype(row_layout.leaves(row_type))
    old = np.zeros(len(data), dtype)
    for name in dtype.names or ():
        old[name] = data[name]
    table = row_table(write(tmp_path, old, row_type=row_type))
    for name in ("share_saturated", "share_gated", "share_dump_on", "surge_stroke"):
        assert np.isnan(table[name].values).all(), name
    assert np.isnan(table["switching_period"].values).all()
    assert table["surge_position_alarm"].values.tolist() == [0, 0]
    assert float(table["lcb_p98"][0]) == pytest.approx(96.0, rel=2e-3)
    assert not any("surge" in text for text in analyse(tmp_path).summary.alarms)


def test_a_row_that_was_not_run_has_no_checks(tmp_path: Path) -> None:
    data = filled()
    table = row_table(write(tmp_path, data[data["plan.row"] != 1]))
    assert table["state"].values.tolist() == ["complete", "not run"]
    for name in (check.name for check in CHECKS):
        assert np.isnan(table[name].values[1]), name


def test_modulation_of_a_custom_drive_is_reported(tmp_path: Path) -> None:
    drive = {"kind": "custom", "modulation": "svpwm"}
    config = {"name": "x", "rig": {"drive": drive}, "campaign": {"drive": {"modulation": None}}}
    table = row_table(write(tmp_path / "rig", filled(), config=config))
    assert table.attrs["modulation"] == "svpwm"
    config = {**config, "campaign": {"drive": {"modulation": "dpwm"}}}
    assert row_table(write(tmp_path / "own", filled(), config=config)).attrs["modulation"] == "dpwm"
    assert "modulation" not in row_table(write(tmp_path / "cots", filled())).attrs
