"""Every session on a simulated bench with hidden constants, from its record to its page."""

import json
import re
from pathlib import Path
from typing import Any

import bench_runs as bench
import numpy as np
import pytest
import xarray
from command_here import rig
from matplotlib.image import imread
from ruamel.yaml import YAML

from rig.kinds.oswec_bench.config.constants_file import ConstantsFile
from rig.kinds.oswec_bench.products import Summary, analyse
from rig.kinds.oswec_bench.products.estimate import Estimate
from rig.kinds.oswec_bench.products.points import open_session
from rig.kinds.oswec_bench.products.report import result_as_dict
from rig.kinds.oswec_bench.products.result import compare
from rig.realtime.reasons import Reason
from rig.realtime.sequence import Phase
from rig.recording.runs import RunError

DEGREE = np.pi / 180.0
TABLE = [(5.0, 42.0), (5.0, 104.0), (10.0, 62.5), (15.0, 42.0), (15.0, 104.0)]
HIDDEN: dict[str, Any] = {
    "transmission__half_gap": 0.031,  # deg
    "transmission__soft_deflection": 0.045,  # deg
    "transmission__soft_torque": 11.0,  # N*m
    "transmission__coupling_stiffness": 90e3,  # N*m/rad: 25.6e3 in all
    "velocity_loop__gain": 1.61,
    "motor__torque_constant": 1.05,  # 15.75 N*m/A at the output
    "bearing__clockwise": 0.09,
    "bearing__counter": 0.14,
}
STIFFNESS = 1.0 / (1.0 / 41250.0 + 1.0 / 90e3 + 1.0 / 264987.0)


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("runs")


@pytest.fixture(scope="module")
def driveline(runs: Path) -> Summary:
    simulated_bench = bench.make_bench(seed=3, **HIDDEN)
    rows = bench.driveline_rows(TABLE)
    return analyse(
        bench.write_session(runs / "driveline", simulated_bench, "driveline", rows, periods=3)
    )


@pytest.fixture(scope="module")
def torque(runs: Path) -> Summary:
    rows = [{"current_amplitude_a": i, "period_s": 8.0} for i in (1.4, 2.5, 3.4, 4.4)]
    simulated_bench = bench.make_bench(seed=4, **HIDDEN)
    return analyse(
        bench.write_session(runs / "torque", simulated_bench, "torque_constant", rows, periods=2)
    )


def files_by_name(summary: Summary, suffix: str) -> dict[str, Path]:
    return {path.name: path for path in summary.files if path.suffix == suffix}


def calibration(summary: Summary) -> ConstantsFile:
    (path,) = files_by_name(summary, ".yaml").values()
    return ConstantsFile.model_validate(YAML(typ="safe").load(path.read_text()))


def test_gap_and_stiffness_of_a_hidden_driveline_are_recovered(driveline: Summary) -> None:
    """The tolerance adds 1 % for the load cell, whose errors are not in the interval."""
    constants = driveline.result.constants
    for name, truth in (
        ("soft_zone_torque", 11.0),
        ("half_gap", 0.031),
        ("soft_zone", 0.045),
        ("stiffness", STIFFNESS),
    ):
        estimate = constants[name]
        assert abs(estimate.value - truth) < estimate.uncertainty + 0.01 * truth, name
    comparisons = {each.quantity: each for each in driveline.result.comparisons}
    trend = comparisons["phase shift over rms velocity"]
    assert trend.verdict == "undecided", trend  # five set points: -0.40 ± 0.60 % per rad/s


@pytest.mark.parametrize(
    ("slope", "error", "verdict"),
    [
        (-0.30, 0.82, "undecided"),
        (0.30, 0.82, "undecided"),
        (-0.30, 0.2, "met"),
        (0.30, 0.2, "missed"),
    ],
)
def test_a_trend_is_undecided_if_its_interval_contains_zero(
    driveline: Summary, slope: float, error: float, verdict: str
) -> None:
    estimate = Estimate(slope, error, "% per rad/s", "drawn")
    compared = compare("phase shift", estimate, "falls, R² 0.81", "falls", estimate.is_negative)
    summary = driveline._replace(result=driveline.result._replace(comparisons=(compared,)))
    assert compared.verdict == verdict
    assert result_as_dict(summary.result)["comparisons"][0]["verdict"] == verdict
    assert ("undecided" in summary.as_text()) is (verdict == "undecided")
    assert summary.targets_met is (verdict != "missed")


def test_a_session_can_read_the_calibration_file(driveline: Summary) -> None:
    constants_file = calibration(driveline)
    assert constants_file.rig == "oswec bench"
    assert constants_file.run == "driveline"
    assert [(p.amplitude_deg, p.damping_n_m_s_per_rad) for p in constants_file.driveline] == TABLE
    assert constants_file.deflection_map is not None
    deflection = np.interp(
        1.0, constants_file.deflection_map.torque_n_m, constants_file.deflection_map.deflection_deg
    )
    assert deflection == pytest.approx(0.031 + 0.045 / 11.0 + 1.0 / STIFFNESS / DEGREE, rel=0.05)
    assert constants_file.constants["stiffness"].method.startswith("map of 5 set points")


def test_every_product_is_written(driveline: Summary) -> None:
    names = {path.name for path in driveline.files}
    assert {f"fig_2_{n}.png" for n in (2, 3, 4, 5, 7, 8, 9)} <= names
    assert {"session.html", "session.json", "calibration.yaml"} <= names
    for path in files_by_name(driveline, ".png").values():
        assert imread(path).std() > 0.03, path.name
    table = xarray.open_dataset(files_by_name(driveline, ".nc")["driveline_points.nc"])
    assert table["deflection 95th"].attrs["units"] == "deg"
    assert table.sizes["point"] == len(TABLE)
    first = files_by_name(driveline, ".csv")["driveline_points.csv"].read_text().splitlines()
    assert first[0].startswith("row,amplitude [deg],R [N*m*s/rad]")
    assert len(first) == 1 + len(TABLE)
    assert json.loads(files_by_name(driveline, ".json")["session.json"].read_text())["session"]


def test_the_page_is_self_contained(driveline: Summary) -> None:
    text = files_by_name(driveline, ".html")["session.html"].read_text()
    sources = re.findall(r'(?:src|href)="([^"]{0,30})', text)
    assert len(sources) == len(driveline.result.figures)
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert "REHEARSAL" in text
    assert "Comparison with the thesis" in text


def test_terminal_and_json_output_agree(driveline: Summary) -> None:
    document = driveline.as_dict()
    assert json.loads(json.dumps(document))["constants"]["stiffness"]["unit"] == "N*m/rad"
    for each in driveline.result.comparisons:
        assert each.quantity in driveline.as_text()
    assert document["targets_met"] == driveline.targets_met


def test_a_correction_is_judged_by_reference_minus_shaft(runs: Path, driveline: Summary) -> None:
    """The correction follows from the uncorrected run, found in the same folder."""
    lag = driveline.result.constants["velocity_loop_lag"].value
    rows = []
    for row, entry in zip(
        bench.driveline_rows(TABLE), calibration(driveline).driveline, strict=True
    ):
        advance = 0.01 * entry.phase_shift_percent * entry.period_s + lag
        extra_amplitude = entry.amplitude_difference_deg
        rows.append(
            {**row, "more_deg": extra_amplitude, "advance_s": advance, "correction": "online"}
        )
    simulated_bench = bench.make_bench(seed=3, **HIDDEN)
    settings = {"correction": {"kind": "online"}}
    run = bench.write_session(
        runs / "online", simulated_bench, "driveline", rows, periods=2, **settings
    )
    summary = analyse(run)
    assert (
        f"Uncorrected set points are those of run {driveline.session.metadata.run}."
        in summary.notes
    )
    (comparison,) = summary.result.comparisons
    assert comparison.target_met
    assert comparison.quantity == "reference minus shaft, online correction"
    assert not files_by_name(summary, ".yaml")  # no calibration results


def test_gain_and_lag_of_the_loaded_drive_are_recovered(driveline: Summary) -> None:
    """The lag is the loop's 1 ms; the age of the readings is removed."""
    constants = driveline.result.constants
    assert constants["velocity_constant_loaded"].value == pytest.approx(1.61, rel=0.002)
    assert 0.0005 < constants["velocity_loop_lag"].value < 0.002


def test_the_torque_constant_of_a_hidden_motor_is_recovered(torque: Summary) -> None:
    constants = torque.result.constants
    motor = constants["torque_constant_motor"]
    assert abs(motor.value - 15.75) < motor.uncertainty + 0.001 * 15.75  # cross-talk of the cell
    assert constants["torque_constant"].value < 15.75  # it includes friction
    assert constants["torque_hysteresis"].value > 1.0
    assert calibration(torque).constants["torque_constant_positive"].unit == "N*m/A"


def test_the_velocity_constant_of_a_hidden_drive_is_recovered(runs: Path) -> None:
    rows = [{"amplitude_deg": a, "period_s": 1.5} for a in (5.0, 9.0, 13.0, 17.0, 20.0)]
    simulated_bench = bench.make_bench("oswec_bench_unbraked", seed=5, gain=1.5708, **HIDDEN)
    run = bench.write_session(
        runs / "velocity", simulated_bench, "velocity_constant", rows, periods=4
    )
    constants = analyse(run).result.constants
    velocity = constants["velocity_constant"]
    assert abs(velocity.value - 1.61) < velocity.uncertainty + 0.002
    assert constants["velocity_constant_deceleration"].value < 0.97 * 1.61
    assert constants["amplitude_difference_unloaded"].value == pytest.approx(0.031, abs=0.003)


def test_the_losses_of_a_hidden_bench_are_recovered(runs: Path, torque: Summary) -> None:
    """The analysis uses the motor's constant of the torque session in the same folder."""
    rows = [{"amplitude_deg": a, "period_s": 1.5} for a in (20.0, 5.0, 15.0, 10.0)]
    simulated_bench = bench.make_bench("oswec_bench_unbraked", seed=6, **HIDDEN)
    run = bench.write_session(runs / "losses", simulated_bench, "losses", rows, periods=6)
    summary = analyse(run)
    constants = summary.result.constants
    assert torque.session.metadata.run in " ".join(summary.notes)
    assert constants["gearbox_dry"].value == pytest.approx(0.8, rel=0.1)
    assert constants["gearbox_inertia"].value == pytest.approx(0.0003 * 225.0, rel=0.05)
    assert constants["bearing_viscous"].value == pytest.approx(0.06, abs=0.01)
    mean_dry = 0.5 * (constants["bearing_positive"].value + constants["bearing_negative"].value)
    assert mean_dry == pytest.approx(0.115, abs=0.01)


def test_both_branches_of_the_brake_are_recovered(runs: Path) -> None:
    currents = [0.0, 0.1, 0.3, 0.6, 0.9, 0.6, 0.3, 0.1]
    rows = [{"amplitude_deg": 10.0, "period_s": 1.5, "brake_current_a": i} for i in currents]
    simulated_bench = bench.make_bench(seed=7)
    summary = analyse(
        bench.write_session(runs / "brake", simulated_bench, "brake_map", rows, periods=2)
    )
    brake_map = calibration(summary).brake_map
    assert brake_map is not None
    brake = simulated_bench.world.params.brake
    for branch, shift in (
        (brake_map.rising, -brake.half_width),
        (brake_map.falling, brake.half_width),
    ):
        currents_on_curve = np.clip(np.array(branch.current_a) + shift, 0.0, None)
        curve = np.interp(currents_on_curve, brake.currents, brake.torques)
        assert branch.torque_n_m[1:-1] == pytest.approx(curve[1:-1] + 0.12, abs=0.15)  # bearing
    assert summary.result.constants["brake_hysteresis"].value > 1.0


def test_a_closed_loop_run_is_judged_by_the_open_loop_run_in_its_folder(runs: Path) -> None:
    rows = [{"torque_amplitude_n_m": a, "period_s": 5.0} for a in (20.0, 50.0)]
    for name, gain, control in (("open", 0.0, "open loop"), ("closed", 20.0, "closed loop")):
        control_rows = [{**row, "integral_per_s": gain} for row in rows]
        simulated_bench = bench.make_bench(seed=8, **HIDDEN)
        bench.write_session(
            runs / name,
            simulated_bench,
            "torque_tracking",
            control_rows,
            periods=1,
            settle=1,
            control=control,
        )
    open_loop = analyse(runs / "open")
    assert "tracking_improvement" not in open_loop.result.constants
    closed_loop = analyse(runs / "closed")
    assert closed_loop.result.comparisons[-1].target_met
    assert "Open loop: run open." in closed_loop.notes


def test_an_analysis_that_is_impossible_is_refused_with_a_reason(
    runs: Path, driveline: Summary
) -> None:
    with pytest.raises(RunError, match="no such run"):
        analyse(runs / "nowhere")
    simulated_bench = bench.make_bench()
    rows = bench.driveline_rows(TABLE[:1])
    unknown = bench.write_session(runs / "strange", simulated_bench, "juggling", rows, periods=1)
    with pytest.raises(RunError, match="'juggling' has no analysis; known kinds:"):
        analyse(unknown)
    with pytest.raises(RunError, match="takes no reference run"):
        analyse(runs / "brake", runs / "driveline")


def test_a_row_shorter_than_planned_is_left_out_with_a_reason(tmp_path: Path) -> None:
    simulated_bench = bench.make_bench(seed=9)
    rows = bench.driveline_rows(TABLE[:2])
    run = bench.write_session(
        tmp_path / "cut", simulated_bench, "driveline", rows, periods=2, plan_periods=4
    )
    session = open_session(run)
    assert [point.incomplete_reason for point in session.points] == ["shorter than planned"] * 2
    with pytest.raises(RunError, match="no set point was measured completely"):
        analyse(run)


def test_a_session_reports_missing_ticks_and_the_cause_of_its_stop(tmp_path: Path) -> None:
    """Row 1 lacks 100 ticks, row 2 all; row 3 lost ticks before its window; row 4 tripped."""

    def damaged(data: Any) -> Any:
        measured = data["plan.phase"] == Phase.MEASURE
        row_1 = np.flatnonzero(measured & (data["plan.row"] == 1))[200:300]
        row_2 = np.flatnonzero(data["plan.row"] == 2)
        before_row_3 = np.flatnonzero(measured & (data["plan.row"] == 3))[0] - np.arange(1, 21)
        trip = int(np.flatnonzero(measured & (data["plan.row"] == 4))[-100])
        data["safety.reason"][trip:] = Reason.DRIVE_DROPPED
        data["timing.skipped"][trip - 500 :] = 30
        data["tick"][trip - 500 :] += 30
        data["tick_end"], data["time"] = data["tick"], data["tick"] * bench.DT
        return np.delete(data[: trip + 5], [*row_1, *row_2, *before_row_3])

    simulated_bench = bench.make_bench(seed=3, **HIDDEN)
    rows = bench.driveline_rows([*TABLE[:2], (8.0, 80.0), *TABLE[2:4]], period=1.0)
    status = {"status": "fault", "reason": "DRIVE_DROPPED"}
    run = bench.write_session(
        tmp_path / "run",
        simulated_bench,
        "driveline",
        rows,
        periods=3,
        edit_record=damaged,
        status=status,
    )
    summary = analyse(run)
    period_ticks = round(1.0 / bench.DT)
    left_out = [note for note in summary.notes if "left out" in note]
    assert left_out == [
        f"Row 1 is left out: 100 of {3 * period_ticks} ticks missing from the record.",
        "Row 2 is left out: all of its ticks are missing from the record.",
        "Row 4 is left out: the log ends here.",
    ]
    assert [point.row for point in open_session(run).complete_points] == [0, 3]
    stop = "Stopped by a fault: the host lost 30 ticks (longest gap 30 ms) in the 2 s before"
    record = f"Record incomplete: {100 + 4 * period_ticks + 20 + 95 + 20} of "
    page = (run / "session.html").read_text()
    for text in (page, rig("show", run).stdout):
        assert stop in text
        assert record in text
        assert text.index(stop) < text.index(record) < text.index("Row 1 is left out")
    document = json.loads(rig("show", run, "--json").stdout)
    assert document["ending"].startswith(stop)
    assert document["lost_ticks"]["lost"] == 30
    assert document["record"]["state"] == "incomplete"
    assert len(document["record"]["missing_ticks"]) == 3  # ticks after the last row have no number
    session_json = json.loads((run / "session.json").read_text())
    assert session_json["record"].startswith("incomplete: ")
    assert session_json["ending"].startswith(stop)


def test_a_complete_session_reports_a_complete_record(driveline: Summary, runs: Path) -> None:
    lines = driveline.as_text().splitlines()
    assert lines[1:3] == ["Complete: the plan ran to its end.", "Record complete."]
    page = (runs / "driveline" / "session.html").read_text()
    assert "<p>Record complete.</p>" in page
    assert driveline.as_dict()["record"]["state"] == "complete"
