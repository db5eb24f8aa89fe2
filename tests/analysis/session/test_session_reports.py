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

from rig.analysis.session import Summary, analyse
from rig.analysis.session.points import open_session
from rig.config.constants_file import ConstantsFile
from rig.realtime.safety import Reason
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
    on = bench.bench(seed=3, **HIDDEN)
    rows = bench.driveline_rows(TABLE)
    return analyse(bench.write_session(runs / "driveline", on, "driveline", rows, periods=3))


@pytest.fixture(scope="module")
def torque(runs: Path) -> Summary:
    rows = [{"current_amplitude_a": i, "period_s": 8.0} for i in (1.4, 2.5, 3.4, 4.4)]
    on = bench.bench(seed=4, **HIDDEN)
    return analyse(bench.write_session(runs / "torque", on, "torque_constant", rows, periods=2))


def written(summary: Summary, ending: str) -> dict[str, Path]:
    return {path.name: path for path in summary.written if path.suffix == ending}


def calibration(summary: Summary) -> ConstantsFile:
    (path,) = written(summary, ".yaml").values()
    return ConstantsFile.model_validate(YAML(typ="safe").load(path.read_text()))


def test_gap_and_stiffness_of_a_hidden_driveline(driveline: Summary) -> None:
    """Beside the statistical interval 1 % for the load cell, whose errors it cannot know."""
    found = driveline.result.constants
    for name, truth in (
        ("soft_zone_torque", 11.0),
        ("half_gap", 0.031),
        ("soft_zone", 0.045),
        ("stiffness", STIFFNESS),
    ):
        known = found[name]
        assert abs(known.value - truth) < known.uncertainty + 0.01 * truth, name
    phase = {each.quantity: each for each in driveline.result.compared}
    assert phase["phase shift over rms velocity"].held


def test_the_calibration_file_is_what_a_session_reads(driveline: Summary) -> None:
    told = calibration(driveline)
    assert told.rig == "oswec bench"
    assert told.run == "driveline"
    assert [(p.amplitude_deg, p.damping_n_m_s_per_rad) for p in told.driveline] == TABLE
    assert told.deflection_map is not None
    near = np.interp(1.0, told.deflection_map.torque_n_m, told.deflection_map.deflection_deg)
    assert near == pytest.approx(0.031 + 0.045 / 11.0 + 1.0 / STIFFNESS / DEGREE, rel=0.05)
    assert told.constants["stiffness"].method.startswith("map of 5 set points")


def test_all_products_are_there(driveline: Summary) -> None:
    names = {path.name for path in driveline.written}
    assert {f"fig_2_{n}.png" for n in (2, 3, 4, 5, 7, 8, 9)} <= names
    assert {"session.html", "session.json", "calibration.yaml"} <= names
    for path in written(driveline, ".png").values():
        assert imread(path).std() > 0.03, path.name
    table = xarray.open_dataset(written(driveline, ".nc")["driveline_points.nc"])
    assert table["deflection 95th"].attrs["units"] == "deg"
    assert table.sizes["point"] == len(TABLE)
    first = written(driveline, ".csv")["driveline_points.csv"].read_text().splitlines()
    assert first[0].startswith("row,amplitude [deg],R [N*m*s/rad]")
    assert len(first) == 1 + len(TABLE)
    assert json.loads(written(driveline, ".json")["session.json"].read_text())["session"]


def test_the_page_needs_nothing_from_elsewhere(driveline: Summary) -> None:
    text = written(driveline, ".html")["session.html"].read_text()
    sources = re.findall(r'(?:src|href)="([^"]{0,30})', text)
    assert len(sources) == len(driveline.result.pictures)
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert "REHEARSAL" in text
    assert "Beside the thesis" in text


def test_the_terminal_and_json_say_the_same(driveline: Summary) -> None:
    told = driveline.as_dict()
    assert json.loads(json.dumps(told))["constants"]["stiffness"]["unit"] == "N*m/rad"
    for each in driveline.result.compared:
        assert each.quantity in driveline.as_text()
    assert told["held"] == driveline.held


def test_a_correction_is_judged_by_reference_less_shaft(runs: Path, driveline: Summary) -> None:
    """By what the uncorrected run found, and against that run, which is found beside it."""
    lag = driveline.result.constants["velocity_loop_lag"].value
    rows = []
    for row, known in zip(
        bench.driveline_rows(TABLE), calibration(driveline).driveline, strict=True
    ):
        late = 0.01 * known.phase_shift_percent * known.period_s + lag
        more = known.amplitude_difference_deg
        rows.append({**row, "more_deg": more, "advance_s": late, "correction": "online"})
    on = bench.bench(seed=3, **HIDDEN)
    told = {"correction": {"kind": "online"}}
    run = bench.write_session(runs / "online", on, "driveline", rows, periods=2, **told)
    summary = analyse(run)
    assert f"Uncorrected set points are those of run {driveline.run}." in summary.notes
    (judged,) = summary.result.compared
    assert judged.held
    assert judged.quantity == "reference less shaft, online correction"
    assert not written(summary, ".yaml")  # nothing to calibrate by


def test_gain_and_lag_of_the_loaded_drive(driveline: Summary) -> None:
    """1 ms of the loop; that of the reading is taken out by its age."""
    found = driveline.result.constants
    assert found["velocity_constant_loaded"].value == pytest.approx(1.61, rel=0.002)
    assert 0.0005 < found["velocity_loop_lag"].value < 0.002


def test_the_torque_constant_of_a_hidden_motor(torque: Summary) -> None:
    found = torque.result.constants
    proper = found["torque_constant_motor"]
    assert abs(proper.value - 15.75) < proper.uncertainty + 0.001 * 15.75  # cross-talk of the cell
    assert found["torque_constant"].value < 15.75  # friction is in it
    assert found["torque_hysteresis"].value > 1.0
    assert calibration(torque).constants["torque_constant_positive"].unit == "N*m/A"


def test_the_velocity_constant_of_a_hidden_drive(runs: Path) -> None:
    rows = [{"amplitude_deg": a, "period_s": 1.5} for a in (5.0, 9.0, 13.0, 17.0, 20.0)]
    on = bench.bench("oswec_bench_unbraked", seed=5, gain=1.5708, **HIDDEN)
    run = bench.write_session(runs / "velocity", on, "velocity_constant", rows, periods=4)
    found = analyse(run).result.constants
    proper = found["velocity_constant"]
    assert abs(proper.value - 1.61) < proper.uncertainty + 0.002
    assert found["velocity_constant_deceleration"].value < 0.97 * 1.61
    assert found["amplitude_difference_unloaded"].value == pytest.approx(0.031, abs=0.003)


def test_losses_of_a_hidden_bench(runs: Path, torque: Summary) -> None:
    """They rest on the motor's constant that the torque session beside them found."""
    rows = [{"amplitude_deg": a, "period_s": 1.5} for a in (20.0, 5.0, 15.0, 10.0)]
    on = bench.bench("oswec_bench_unbraked", seed=6, **HIDDEN)
    run = bench.write_session(runs / "losses", on, "losses", rows, periods=6)
    summary = analyse(run)
    found = summary.result.constants
    assert torque.run in " ".join(summary.notes)
    assert found["gearbox_dry"].value == pytest.approx(0.8, rel=0.1)
    assert found["gearbox_inertia"].value == pytest.approx(0.0003 * 225.0, rel=0.05)
    assert found["bearing_viscous"].value == pytest.approx(0.06, abs=0.01)
    both = 0.5 * (found["bearing_positive"].value + found["bearing_negative"].value)
    assert both == pytest.approx(0.115, abs=0.01)


def test_both_branches_of_the_brake(runs: Path) -> None:
    currents = [0.0, 0.1, 0.3, 0.6, 0.9, 0.6, 0.3, 0.1]
    rows = [{"amplitude_deg": 10.0, "period_s": 1.5, "brake_current_a": i} for i in currents]
    on = bench.bench(seed=7)
    summary = analyse(bench.write_session(runs / "brake", on, "brake_map", rows, periods=2))
    told = calibration(summary).brake_map
    assert told is not None
    brake = on.world.params.brake
    for branch, aside in ((told.rising, -brake.half_width), (told.falling, brake.half_width)):
        at = np.clip(np.array(branch.current_a) + aside, 0.0, None)
        curve = np.interp(at, brake.currents, brake.torques)
        assert branch.torque_n_m[1:-1] == pytest.approx(curve[1:-1] + 0.12, abs=0.15)  # bearing
    assert summary.result.constants["brake_hysteresis"].value > 1.0


def test_closed_loop_is_judged_by_the_open_loop_beside_it(runs: Path) -> None:
    rows = [{"torque_amplitude_n_m": a, "period_s": 5.0} for a in (20.0, 50.0)]
    for name, gain, control in (("open", 0.0, "open loop"), ("closed", 20.0, "closed loop")):
        mine = [{**row, "integral_per_s": gain} for row in rows]
        on = bench.bench(seed=8, **HIDDEN)
        bench.write_session(
            runs / name, on, "torque_tracking", mine, periods=1, settle=1, control=control
        )
    alone = analyse(runs / "open")
    assert "tracking_improvement" not in alone.result.constants
    judged = analyse(runs / "closed")
    assert judged.result.compared[-1].held
    assert "Open loop: run open." in judged.notes


def test_what_cannot_be_analysed_says_why(runs: Path, driveline: Summary) -> None:
    with pytest.raises(RunError, match="no such run"):
        analyse(runs / "nowhere")
    on = bench.bench()
    rows = bench.driveline_rows(TABLE[:1])
    strange = bench.write_session(runs / "strange", on, "juggling", rows, periods=1)
    with pytest.raises(RunError, match="'juggling' has no analysis; there are"):
        analyse(strange)
    with pytest.raises(RunError, match="is not judged against another run"):
        analyse(runs / "brake", runs / "driveline")


def test_a_row_that_was_cut_short_is_left_out_and_told(tmp_path: Path) -> None:
    on = bench.bench(seed=9)
    rows = bench.driveline_rows(TABLE[:2])
    run = bench.write_session(tmp_path / "cut", on, "driveline", rows, periods=2, plan_periods=4)
    session = open_session(run)
    assert [point.incomplete_reason for point in session.points] == ["shorter than planned"] * 2
    with pytest.raises(RunError, match="no set point was measured to its end"):
        analyse(run)


def test_a_session_names_what_its_record_lacks_and_what_stopped_it(tmp_path: Path) -> None:
    """Row 1 lacks 100 ticks, row 2 all; row 3 lost some before it began; row 4 tripped."""

    def torn(data: Any) -> Any:
        measured = data["plan.phase"] == Phase.MEASURE
        one = np.flatnonzero(measured & (data["plan.row"] == 1))[200:300]
        two = np.flatnonzero(data["plan.row"] == 2)
        three = np.flatnonzero(measured & (data["plan.row"] == 3))[0] - np.arange(1, 21)
        trip = int(np.flatnonzero(measured & (data["plan.row"] == 4))[-100])
        data["safety.reason"][trip:] = Reason.DRIVE_DROPPED
        data["timing.skipped"][trip - 500 :] = 30
        data["tick"][trip - 500 :] += 30
        data["tick_end"], data["time"] = data["tick"], data["tick"] * bench.DT
        return np.delete(data[: trip + 5], [*one, *two, *three])

    on = bench.bench(seed=3, **HIDDEN)
    rows = bench.driveline_rows([*TABLE[:2], (8.0, 80.0), *TABLE[2:4]], period=1.0)
    ended = {"status": "fault", "reason": "DRIVE_DROPPED"}
    run = bench.write_session(
        tmp_path / "run", on, "driveline", rows, periods=3, change=torn, status=ended
    )
    found = analyse(run)
    per = round(1.0 / bench.DT)
    left_out = [note for note in found.notes if "left out" in note]
    assert left_out == [
        f"Row 1 is left out: 100 of {3 * per} ticks missing from the record.",
        "Row 2 is left out: all of its ticks are missing from the record.",
        "Row 4 is left out: the log ends here.",
    ]
    assert [point.row for point in open_session(run).whole] == [0, 3]
    stop = "Stopped by a fault: the host lost 30 ticks (longest gap 30 ms) in the 2 s before"
    record = f"Record incomplete: {100 + 4 * per + 20 + 95 + 20} of "
    page = (run / "session.html").read_text()
    for text in (page, rig("show", run).stdout):
        assert stop in text
        assert record in text
        assert text.index(stop) < text.index(record) < text.index("Row 1 is left out")
    told = json.loads(rig("show", run, "--json").stdout)
    assert told["ending"].startswith(stop)
    assert told["lost_ticks"]["lost"] == 30
    assert told["record"]["state"] == "incomplete"
    assert len(told["record"]["missing_ticks"]) == 3  # what followed the last row has no number
    kept = json.loads((run / "session.json").read_text())
    assert kept["record"].startswith("incomplete: ")
    assert kept["ending"].startswith(stop)


def test_a_whole_session_says_that_its_record_is(driveline: Summary, runs: Path) -> None:
    lines = driveline.as_text().splitlines()
    assert lines[1:3] == ["Complete: the plan was walked to its end.", "Record complete."]
    page = (runs / "driveline" / "session.html").read_text()
    assert "<p>Record complete.</p>" in page
    assert driveline.as_dict()["record"]["state"] == "complete"
