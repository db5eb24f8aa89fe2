"""The row table against closed forms: means, errors, incomplete windows."""

import csv
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple, get_type_hints

import numpy as np
import pytest
import synthetic_runs as synthetic
import xarray
from scipy import stats
from synthetic_runs import POWERS, Row, Shape

from rig.analysis.points import gain_matrix
from rig.analysis.rows import INCOMPLETE, row_table, write_rows
from rig.analysis.scatter import period_means, successive_error
from rig.analysis.slices import find_optima
from rig.kinds.wavebot.tick import WaveBotRow
from rig.realtime.limits import LimitFlag, WarningFlag
from rig.realtime.reasons import Reason
from rig.realtime.safety import Mode
from rig.realtime.sequence import Phase
from rig.recording import row_layout
from rig.recording.runs import open_run
from rig.recording.runs.mcap_file import row_dtype

POWER = {"mechanical_1": -80.0, "mechanical_2": -60.0, "ac": -40.0, "dc": -5.0}


def planned(count: int, repetitions: int = 1) -> list[Row]:
    rows = []
    for i in range(count):
        for repetition in range(repetitions):
            power = {kind: value + i for kind, value in POWER.items()}
            rows.append(Row(i, repetition, 490.9, -2000.0, 1000.0 * i, power))
    return rows


def table_of(folder: Path, data: Any, rows: list[Row], shape: Shape) -> xarray.Dataset:
    synthetic.write_run(folder, data, synthetic.plan_json(rows, shape))
    return row_table(folder)


def run(folder: Path, rows: list[Row], shape: Shape) -> xarray.Dataset:
    return table_of(folder, synthetic.run_rows(rows, shape), rows, shape)


def test_means_of_sinusoids_are_exact(tmp_path: Path) -> None:
    rows, shape = planned(3), Shape()
    table = run(tmp_path, rows, shape)
    for i, row in enumerate(rows):
        measured = table.isel(row=i)
        for kind, value in row.power.items():
            assert float(measured[f"power_{kind}"]) == pytest.approx(value, abs=1e-9)
            assert float(measured[f"power_{kind}_se"]) == pytest.approx(0.0, abs=1e-9)
        for kind in ("mechanical_1", "mechanical_2"):  # the cell's offset of 12 N drops out
            assert float(measured[f"power_{kind}_demeaned"]) == pytest.approx(
                row.power[kind], abs=1e-9
            )
        assert float(measured["velocity_rms"]) == pytest.approx(0.2 / np.sqrt(2.0))
        assert float(measured["current_peak"]) == pytest.approx(4.0)
        assert float(measured["force_mean"]) == pytest.approx(0.0, abs=1e-9)
        assert float(measured["stroke"]) == pytest.approx(2.0 * 0.2 / np.pi)
        assert (float(measured["kp"]), float(measured["ki"])) == (row.kp, row.ki)
    assert table["periods"].values.tolist() == [5, 5, 5]
    assert table["samples"].values.tolist() == [1000, 1000, 1000]
    assert set(table["state"].values) == {"complete"}
    assert table["power_ac"].attrs["units"] == "W"
    assert table["kp"].attrs["units"] == "N*s/m"


def test_only_measured_ticks_count(tmp_path: Path) -> None:
    rows, shape = planned(2), Shape()
    data = synthetic.run_rows(rows, shape)
    data["power.ac"][data["plan.phase"] != Phase.MEASURE] = 1e6
    table = table_of(tmp_path, data, rows, shape)
    assert table["power_ac"].values == pytest.approx([-40.0, -39.0])


def test_periods_of_a_fractional_number_of_ticks() -> None:
    ticks = np.arange(1333)  # four periods of 0.3 Hz at 100 Hz, ends on the nearest sample
    period = 100.0 / 0.3
    power = 10.0 + 7.0 * np.sin(2.0 * np.pi * ticks / period)
    means = period_means(power, ticks, period)
    assert len(means) == 4
    assert means == pytest.approx(np.full(4, 10.0), abs=0.05)


def test_a_lost_tick_shifts_no_period() -> None:
    ticks = np.delete(np.arange(500), [3, 7, 250])
    values = (ticks // 100).astype(float)
    assert period_means(values, ticks, 100.0).tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_the_standard_error_covers() -> None:
    random = np.random.default_rng(11)
    periods, trials, truth = 7, 4000, -50.0
    ticks = np.arange(periods * 40)
    inside = 0
    for _ in range(trials):
        wander = np.repeat(random.normal(0.0, 2.0, periods), 40)
        swing = 30.0 * np.sin(2.0 * np.pi * ticks / 40.0)
        power = truth + wander + swing + random.normal(0.0, 5.0, len(ticks))
        scatter = successive_error(period_means(power, ticks, 40.0))
        bound = stats.t.ppf(0.975, scatter.dof) * scatter.error
        inside += abs(power.mean() - truth) <= bound
    # Three standard deviations of a binomial around 95 %.
    assert inside / trials == pytest.approx(0.95, abs=3.0 * np.sqrt(0.05 * 0.95 / trials))


def test_the_error_of_a_run_is_that_of_its_wander(tmp_path: Path) -> None:
    shape = Shape(wander=3.0, noise=1.0, periods=10)
    table = run(tmp_path, planned(60), shape)
    expected = np.sqrt((3.0**2 + 1.0**2 / 200.0) / 10.0)
    independent = table["power_ac_dof"].values == 9.0
    assert independent.mean() > 0.85  # white scatter passes for correlated in a row of twenty
    squares = np.mean(table["power_ac_se"].values[independent] ** 2)
    assert np.sqrt(squares) == pytest.approx(expected, rel=0.1)


def test_one_repeat_period_of_an_irregular_sea_has_no_error(tmp_path: Path) -> None:
    shape = Shape(periods=1, irregular_repeat=30.0, noise=1.0)
    table = run(tmp_path, planned(2), shape)
    assert table["periods"].values.tolist() == [1, 1]
    for kind in POWERS:
        assert np.isnan(table[f"power_{kind}_se"].values).all()
    assert all(np.isnan(best.error) for best in find_optima(table))


def test_repetitions_give_the_error(tmp_path: Path) -> None:
    shape = Shape(periods=1, irregular_repeat=10.0, wander=2.0)
    table = run(tmp_path, planned(2, repetitions=4), shape)
    for point in gain_matrix(table).points:
        means = table["power_ac"].values[list(point.rows)]
        assert len(means) == 4
        assert point.power["ac"] == pytest.approx(means.mean())
        assert point.error["ac"] == pytest.approx(np.std(means, ddof=1) / 2.0)
        rows = table["power_ac_se"].values[list(point.rows)]
        assert rows == pytest.approx(np.full(4, np.std(means, ddof=1)))  # of a single row


def without(data: Any, gap: slice, *, skipped: bool) -> Any:
    """Return a run without some ticks of row 1: skipped by the loop, or lost from the record."""
    inside = np.flatnonzero((data["plan.row"] == 1) & (data["plan.phase"] == Phase.MEASURE))[gap]
    if skipped:
        data["timing.skipped"][inside[-1] + 1 :] += len(inside)
    return np.delete(data, inside)


def test_ticks_skipped_by_the_loop_are_counted(tmp_path: Path) -> None:
    rows, shape = planned(2), Shape()
    data = without(synthetic.run_rows(rows, shape), slice(100, 107), skipped=True)
    table = table_of(tmp_path, data, rows, shape)
    assert table["lost_ticks"].values.tolist() == [0, 7]
    assert table["samples"].values.tolist() == [1000, 993]
    assert table["ticks_expected"].values.tolist() == [1000, 993]
    assert table["ticks_missing"].values.tolist() == [0, 0]
    assert set(table["state"].values) == {"complete"}
    assert table.attrs["record"] == "complete"


def test_a_row_without_recorded_ticks_is_incomplete_and_not_unrun(tmp_path: Path) -> None:
    rows, shape = planned(3), Shape()
    data = without(synthetic.run_rows(rows, shape), slice(None), skipped=False)
    table = table_of(tmp_path, data, rows, shape)
    assert table["state"].values.tolist() == ["complete", INCOMPLETE, "complete"]
    assert table["incomplete_reason"].values[1] == "all of its ticks are missing from the record"


@pytest.mark.parametrize("gap", [slice(100, 107), slice(0, 7), slice(993, 1000)])
def test_a_row_with_missing_ticks_is_withheld(gap: slice, tmp_path: Path) -> None:
    """Ticks missing at the beginning or end are detected from the plan."""
    rows, shape = planned(3), Shape()
    data = without(synthetic.run_rows(rows, shape), gap, skipped=False)
    plan = synthetic.plan_json(rows, shape)
    for row in plan["rows"]:
        row["measure_s"] = 1000 * shape.dt
    table = row_table(synthetic.write_run(tmp_path, data, plan))
    assert table["state"].values.tolist() == ["complete", INCOMPLETE, "complete"]
    assert table["incomplete_reason"].values[1] == "7 of 1000 ticks missing from the record"
    assert table["samples"].values.tolist() == [1000, 993, 1000]
    assert table["ticks_expected"].values.tolist() == [1000, 1000, 1000]
    assert table["ticks_missing"].values.tolist() == [0, 7, 0]
    for name in ("power_dc", "power_dc_se", "position_rms", "stroke", "bus_voltage_mean"):
        assert np.isnan(table[name].values).tolist() == [False, True, False], name
    assert table["kp"].values.tolist() == [row.kp for row in rows]
    assert [point.rows for point in gain_matrix(table).points] == [(0,), (2,)]
    assert table.attrs["record"].startswith("incomplete: 7 of ")
    with_incomplete = row_table(tmp_path, incomplete_rows=True)
    assert set(with_incomplete["state"].values) == {"complete"}
    assert np.isfinite(with_incomplete["power_dc"].values).all()
    assert with_incomplete["ticks_missing"].values[1] == 7


def test_limits_and_alarms_are_named(tmp_path: Path) -> None:
    rows, shape = planned(3), Shape()
    data = synthetic.run_rows(rows, shape)
    second = np.flatnonzero((data["plan.row"] == 1) & (data["plan.phase"] == Phase.MEASURE))
    data["heave.command.limited"][second[5]] = LimitFlag.CURRENT_PEAK
    data["heave.command.limited"][second[9]] = LimitFlag.SLEW
    data["heave.warned"][second[5]] = WarningFlag.POSITION
    data["heave.estimate.position"][data["plan.row"] == 2] += 0.006
    table = table_of(tmp_path, data, rows, shape)
    assert table["limits"].values.tolist() == ["", "CURRENT_PEAK SLEW", ""]
    assert table["warned"].values.tolist() == ["", "POSITION", ""]
    assert table["position_alarm"].values.tolist() == [0, 0, 1]
    assert row_table(tmp_path, mean_position_alarm=0.01)["position_alarm"].values.tolist() == [
        0,
        0,
        0,
    ]


def test_old_run_with_a_renamed_field(tmp_path: Path) -> None:
    rows, shape = planned(2), Shape()
    data = synthetic.run_rows(rows, shape)
    data["heave.warned"][data["plan.row"] == 1] = WarningFlag.POSITION
    hints = get_type_hints(WaveBotRow, include_extras=True)
    axis = get_type_hints(hints["heave"], include_extras=True)
    safety = get_type_hints(hints["safety"], include_extras=True)
    flag = axis.pop("warned")
    old_hints = hints | {
        "heave": NamedTuple("Heave", list(axis.items())),
        "safety": NamedTuple("Safety", [*safety.items(), ("warned", flag)]),
    }
    row_type = NamedTuple("WaveBotRow", list(old_hints.items()))
    dtype = row_dtype(row_layout.leaves(row_type))
    assert "safety.warned" in dtype.names
    old_data = np.zeros(len(data), dtype)
    for name in dtype.names:
        old_data[name] = data["heave.warned" if name == "safety.warned" else name]
    plan = synthetic.plan_json(rows, shape)
    synthetic.write_run(tmp_path / "old", old_data, plan, row_type=row_type)
    synthetic.write_run(tmp_path / "new", data, plan)
    before, after = row_table(tmp_path / "old"), row_table(tmp_path / "new")
    assert before.drop_attrs().identical(after.drop_attrs())
    assert before["warned"].values.tolist() == ["", "POSITION"]
    warned = open_run(tmp_path / "old", ["heave.warned"])["heave.warned"]
    assert np.array_equal(warned.values, data["heave.warned"])


def stopped(data: Any, row: int, reason: Reason) -> Any:
    """Return a run that stops 300 ticks into a row's window, as logged by the cycle."""
    at = np.flatnonzero((data["plan.row"] == row) & (data["plan.phase"] == Phase.MEASURE))[300]
    cut = data[: at + 40].copy()
    cut["safety.mode"][at:] = Mode.STOP_1
    cut["safety.reason"][at:] = reason
    cut["plan.phase"][at + 1 :] = Phase.DONE  # the plan is left one tick after the stop
    cut["plan.row"][at + 1 :] = -1
    return cut


def test_a_row_cut_short_by_a_stop(tmp_path: Path) -> None:
    rows, shape = planned(4), Shape()
    data = stopped(synthetic.run_rows(rows, shape), 2, Reason.POSITION)
    table = table_of(tmp_path, data, rows, shape)
    assert table["state"].values.tolist() == ["complete", "complete", "cut short", "not run"]
    assert table["incomplete_reason"].values[2] == "held or stopped"
    assert np.isnan(table["power_ac"].values[3])
    assert [point.rows for point in gain_matrix(table).points] == [(0,), (1,)]


def test_a_row_cut_short_by_the_end_of_the_log(tmp_path: Path) -> None:
    rows, shape = planned(3), Shape()
    data = synthetic.run_rows(rows, shape)
    at = np.flatnonzero((data["plan.row"] == 1) & (data["plan.phase"] == Phase.MEASURE))[-2]
    table = table_of(tmp_path, data[:at], rows, shape)
    assert table["state"].values.tolist() == ["complete", "cut short", "not run"]
    assert table["incomplete_reason"].values[1] == "the log ends here"


def test_a_window_shorter_than_planned(tmp_path: Path) -> None:
    rows, shape = planned(2), Shape()
    plan = synthetic.plan_json(rows, shape)
    for row in plan["rows"]:
        row["measure_s"] = 10.0 if row["row"] == 0 else 11.0
    synthetic.write_run(tmp_path, synthetic.run_rows(rows, shape), plan)
    assert row_table(tmp_path)["state"].values.tolist() == ["complete", "cut short"]


def test_after_a_hold_only_the_last_attempt_counts(tmp_path: Path) -> None:
    rows, shape = planned(2), Shape()
    data = synthetic.run_rows(rows, shape)
    first = data[(data["plan.row"] == 1) & (data["plan.phase"] == Phase.MEASURE)].copy()
    begin = np.flatnonzero(data["plan.row"] == 1)[0]
    first["power.ac"] = 999.0
    stopped_part = first[:400]
    stopped_part["safety.mode"][300:] = Mode.STOP_2
    second = data[begin:].copy()
    second["plan.attempt"][second["plan.row"] == 1] = 1
    joined = synthetic.stamped(np.concatenate([data[:begin], stopped_part, second]), shape.dt)
    table = table_of(tmp_path, joined, rows, shape)
    assert table["state"].values.tolist() == ["complete", "complete"]
    assert table["attempt"].values.tolist() == [0, 1]
    assert table["power_ac"].values == pytest.approx([-40.0, -39.0])


def test_without_a_plan_the_log_gives_the_gains(tmp_path: Path) -> None:
    rows, shape = planned(2), Shape()
    synthetic.write_run(tmp_path, synthetic.run_rows(rows, shape), {})
    table = row_table(tmp_path)
    assert table["ki"].values.tolist() == [0.0, 1000.0]
    assert table["stator"].values.tolist() == [-13.0, -13.0]
    assert np.isnan(table["power_ac_se"].values).all()  # no wave period is known


def test_files_of_the_table(tmp_path: Path) -> None:
    table = run(tmp_path, planned(2), Shape())
    text, binary = write_rows(table, tmp_path)
    with text.open() as file:
        lines = list(csv.DictReader(file))
    assert float(lines[1]["power_ac [W]"]) == pytest.approx(-39.0)
    assert float(lines[1]["ki [N/m]"]) == 1000.0
    assert lines[0]["state"] == "complete"
    with xarray.open_dataset(binary, engine="h5netcdf") as back:
        assert back["power_dc"].attrs["units"] == "W"
        assert np.array_equal(back["power_dc"].values, table["power_dc"].values)
        assert back["state"].values.tolist() == ["complete", "complete"]


def test_the_best_point_and_whether_it_lies_at_the_edge(tmp_path: Path) -> None:
    table = run(tmp_path, synthetic.default_rows(), Shape())
    best = {(o.station.name, o.point.setting["spring_rate"]): o for o in find_optima(table)}
    assert len(best) == 8
    ac = best["ac", 490.9]
    assert (ac.point.setting["kp"], ac.point.setting["ki"], ac.at_edge, ac.points) == (
        -2500.0,
        4000.0,
        False,
        36,
    )
    assert ac.power == pytest.approx(-55.0)
    table = run(tmp_path / "slope", planned(4), Shape())  # power grows with Ki
    assert [o.at_edge for o in find_optima(table)] == [True] * 4


@pytest.mark.parametrize(
    ("best", "missing", "edge", "gap"),
    [
        ((-2000, 2000), [], False, False),
        ((-2000, 0), [], True, False),
        ((-3000, 2000), [], True, False),
        # planned rows that were not measured are gaps, not edges
        ((-2000, 2000), [(-3000, ki) for ki in (0, 2000, 4000)], False, True),
        ((-2000, 2000), [(kp, 4000) for kp in (-1000, -2000, -3000)], False, True),
        ((-2000, 2000), [(-2000, 0)], False, True),
        ((-2000, 2000), [(-1000, 0), (-3000, 4000)], False, False),  # no neighbours
        ((-2000, 0), [(-2000, 2000)], True, True),
        ((-2000, 0), [(kp, 2000) for kp in (-1000, -2000, -3000)], True, True),
    ],
)
def test_missing_rows_move_no_edge(
    tmp_path: Path,
    best: tuple[float, float],
    missing: list[tuple[float, float]],
    edge: bool,
    gap: bool,
) -> None:
    bowl = synthetic.bowl(*best, -80.0, 90.0)
    rows = [
        Row(i, 0, 490.9, float(kp), float(ki), dict.fromkeys(POWERS, bowl(kp, ki)))
        for i, (kp, ki) in enumerate(product((-1000, -2000, -3000), (0, 2000, 4000)))
    ]
    rows.append(Row(9, 0, -5715.0, -9000.0, 9000.0, POWER))  # another panel has other edges
    table = run(tmp_path, rows, Shape(periods=1))
    for i, row in enumerate(rows):
        if (row.kp, row.ki) in missing:
            table["state"][i] = "cut short" if i % 2 else "not run"
    optima = [o for o in find_optima(table) if o.point.setting["spring_rate"] == 490.9]
    assert {(o.point.setting["kp"], o.point.setting["ki"]) for o in optima} == {best}
    assert {(o.at_edge, o.at_gap) for o in optima} == {(edge, gap)}
    place = "grid's edge" if edge else "next to a gap" if gap else ""
    # One period: without a standard error no point is certainly the best.
    assert {o.caveat for o in optima} == {"; ".join(filter(None, ("undecided", place)))}


def test_nan_power_is_a_gap_of_that_station_only(tmp_path: Path) -> None:
    table = run(tmp_path, synthetic.default_rows(), Shape(periods=1))
    table["power_ac"][(table["kp"] == -3000.0) & (table["ki"] == 4000.0)] = np.nan
    gaps = {
        (o.station.name, o.point.setting["spring_rate"]): (o.at_edge, o.at_gap)
        for o in find_optima(table)
    }
    assert gaps["ac", 490.9] == (False, True)  # its best is at Kp -2500, Ki 4000
    assert gaps["mechanical_1", -5715.0] == (False, False)
