"""Reports of a trip name the ticks that the host lost before it first."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pytest
import synthetic_runs as synthetic
from command_here import rig
from matplotlib.image import imread

from rig.analysis import traces
from rig.analysis.report import write_products
from rig.analysis.stop_reason import LostTicks, describe_reason, find_stop, lost_before_trip
from rig.api.campaign_run import lost_ticks
from rig.cli.run import print_end
from rig.realtime.reasons import Reason, reason_table
from rig.realtime.sequence import Phase
from rig.recording.runs import RunError
from rig.recording.runs.folder import earlier_reasons

DT = 0.001
SHAPE = synthetic.Shape()
ROWS = synthetic.default_rows()[:8]


def loop(*gaps: tuple[int, int], periods: int = 5000) -> tuple[Any, Any]:
    """Return executed ticks and skipped periods so far; ``gaps``: last tick before, number lost."""
    lost = np.zeros(periods, bool)
    for before, count in gaps:
        lost[before + 1 : before + 1 + count] = True
    ran = np.flatnonzero(~lost)
    return ran, np.cumsum(lost)[ran]


@pytest.mark.parametrize(
    ("gaps", "lost", "longest"),
    [
        (((4900, 20),), 20, 0.020),
        (((4900, 19),), None, None),
        (((3010, 20),), 20, 0.020),  # 2 s before the last tick, 4999
        (((2900, 90),), None, None),  # longer ago
        (((2990, 30),), 30, 0.030),  # the gap ends within
        (((4978, 20),), 20, 0.020),  # the tick after it trips
        (tuple((3100 + 40 * i, 1) for i in range(41)), 41, 0.001),
        (tuple((3100 + 40 * i, 1) for i in range(40)), None, None),  # 2 % of 2000
        (((3500, 60), (4000, 45), (4500, 1)), 106, 0.060),
        ((), None, None),
    ],
)
def test_lost_ticks_that_can_cause_a_trip(
    gaps: tuple[tuple[int, int], ...], lost: int | None, longest: float | None
) -> None:
    lost_ticks = lost_before_trip(*loop(*gaps), DT)
    if lost is None:
        assert lost_ticks is None
        return
    assert lost_ticks is not None
    assert lost_ticks.lost == lost
    assert lost_ticks.longest_gap_s == pytest.approx(longest)
    assert lost_ticks.share == pytest.approx(lost / 2000, rel=0.02)


def test_a_run_shorter_than_the_window() -> None:
    lost_ticks = lost_before_trip(*loop((100, 50), periods=500), DT)
    assert lost_ticks == pytest.approx((50, 0.05, 50 / 499, 0.499))
    assert lost_before_trip(*loop(periods=1), DT) is None


def test_rows_missing_from_the_log_do_not_count() -> None:
    ticks, skipped = loop()
    kept = np.delete(np.arange(len(ticks)), np.arange(4000, 4400))
    assert lost_before_trip(ticks[kept], skipped[kept], DT) is None


def test_reason_texts() -> None:
    lost = LostTicks(226, 0.0453, 0.11, 2.0)
    assert describe_reason("DRIVE_DROPPED", "the drive switched its power off by itself", lost) == (
        "the host lost 226 ticks (longest gap 45 ms) in the 2 s before the rig tripped: "
        "DRIVE_DROPPED (the drive switched its power off by itself) may be a consequence; "
        "see `rig doctor`"
    )
    text = describe_reason("LOST_TICKS", "too many ticks were lost in one gap", lost)
    assert text.endswith("too many ticks were lost in one gap (LOST_TICKS); see `rig doctor`")
    limit = "the limit was reached"
    assert describe_reason("VELOCITY", limit, None) == f"{limit} (VELOCITY)"
    assert describe_reason("", limit, None) == limit


def tripped(
    folder: Path, reason: Reason = Reason.DRIVE_DROPPED, gap: int = 30, row: int = 2, **more: Any
) -> Path:
    """A synthetic run at 100 Hz that trips in a row with a gap 1 s before."""
    data = synthetic.run_rows(ROWS, SHAPE)
    at = int(np.flatnonzero((data["plan.row"] == row) & (data["plan.phase"] == Phase.MEASURE))[300])
    data["safety.reason"][at:] = reason
    data["timing.skipped"][at - 100 :] = gap
    data["tick"][at - 100 :] += gap
    data["tick_end"] = data["tick"]
    data["time"] = data["tick"] * SHAPE.dt
    plan = more.pop("plan", synthetic.plan_json(ROWS, SHAPE))
    status = {"status": "fault", "reason": reason.name, **more.pop("status", {})}
    return synthetic.write_run(folder, data[: at + 5], plan, **status, **more)


def test_all_products_report_lost_ticks(tmp_path: Path) -> None:
    run = tripped(tmp_path / "run")
    first = "the host lost 30 ticks (longest gap 300 ms) in the 2 s before the rig tripped: DRIVE_D"
    write_products(run)
    text = (run / "summary.txt").read_text()
    assert f"Stopped by a fault: {first}" in text
    summary = json.loads((run / "summary.json").read_text())
    assert summary["reason"].startswith(first)
    assert summary["lost_ticks"] == pytest.approx(
        {"lost": 30, "longest_gap_s": 0.3, "share": 30 / 201, "window_s": 2.0}
    )
    assert first in rig("show", run).stdout
    assert json.loads(rig("show", run, "--json").stdout)["lost_ticks"]["lost"] == 30


@pytest.mark.parametrize("reason", [Reason.OPERATOR_STOP, Reason.OPERATOR_ABORT, Reason.PLAN_END])
def test_stops_that_are_no_trips_report_no_lost_ticks(reason: Reason, tmp_path: Path) -> None:
    assert find_stop(tripped(tmp_path, reason), {}).lost is None


def test_a_trip_without_lost_ticks_reports_only_its_reason(tmp_path: Path) -> None:
    run = tripped(tmp_path / "run", gap=1)
    summary = json.loads(rig("show", run, "--json").stdout)
    assert (summary["lost_ticks"], summary["reason"]) == (
        None,
        "the drive switched its power off by itself (DRIVE_DROPPED)",
    )


def test_a_trip_is_shown_with_name_first_message_and_advice(tmp_path: Path) -> None:
    """The advice is that of the run's own table of reasons, as each plan records it."""
    plan = synthetic.plan_json(ROWS, SHAPE) | {"reasons": reason_table().as_records()}
    status = {"messages": ["drive: slew = nan", "drive: late"]}
    run = tripped(tmp_path / "run", gap=1, plan=plan, status=status)
    lines = rig("show", run).stdout.splitlines()
    begin = lines.index(
        "Stopped by a fault: the drive switched its power off by itself (DRIVE_DROPPED)."
    )
    advice = "To do: Check supply and enable chain of the drive."
    assert lines[begin + 1 : begin + 3] == ["First message: drive: slew = nan", advice]
    lost = tripped(tmp_path / "lost", gap=30, plan=plan)
    assert "To do" not in rig("show", lost).stdout  # the computer is to be checked first


def test_plot_draws_the_last_seconds_of_a_trip(tmp_path: Path) -> None:
    """From 4 s before the trip to the last tick, with a line at the trip."""
    run = tripped(tmp_path / "run", gap=1)
    with mock.patch.object(traces, "_draw", wraps=traces._draw) as draw:
        done = rig("plot", run)
    assert done.returncode == 0, done.stderr
    assert str(run / "trip.png") in done.stdout.splitlines()
    assert imread(run / "trip.png").std() > 0.02
    _, _, data, names, _, mark = draw.call_args.args
    assert f"stopped {mark:.3f} s after" in find_stop(run, {}).location
    assert data["time"][0] == pytest.approx(mark - 4.0, abs=0.5 * SHAPE.dt)
    assert data["time"][-1] == pytest.approx(mark + 4 * SHAPE.dt)
    assert {"heave.estimate.position", "load.age", "heave.command.force"} <= {*names}
    stopped = tripped(tmp_path / "stopped", Reason.OPERATOR_STOP, status={"status": "stopped"})
    assert "trip.png" not in rig("plot", stopped).stdout


def test_the_stop_is_that_of_the_last_stage(tmp_path: Path) -> None:
    """A resumed run that trips elsewhere, and one whose last stage was refused before a tick."""
    run = tripped(tmp_path / "run", gap=1)
    (run / "run.mcap").rename(run / "earlier-1.mcap")
    assert find_stop(run, {"status": "refused"}).location == ""
    second = tripped(tmp_path / "second", gap=1, row=5)
    resumed = synthetic.plan_json(ROWS, SHAPE) | {"dt": SHAPE.dt, "resumed": {"last_tick": 99_999}}
    plan = tripped(tmp_path / "third", gap=1, row=5, plan=resumed)
    shutil.copy(plan / "run.mcap", run / "run.mcap")
    alone = find_stop(second, {"status": "fault"}).location
    assert alone.endswith("row 5 (measure)")
    seconds = float(alone.split()[1]) + 100_000 * SHAPE.dt
    assert find_stop(run, {"status": "fault"}).location == (
        f"stopped {seconds:.3f} s after its start, row 5 (measure)"
    )


def test_sessions_report_lost_ticks(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`rig bench` at its end, and `rig show` of a session without results."""
    config = {
        "session": {"session": "driveline", "name": "x"},
        "rig": {"kind": "oswec bench", "name": "a bench"},
    }
    run = tripped(tmp_path / "run", config=config)
    outcome = SimpleNamespace(status="fault", reason="DRIVE_DROPPED")
    ended: Any = SimpleNamespace(folder=run, outcome=outcome, reasons=earlier_reasons())
    lost = lost_ticks(ended)
    assert lost is not None
    print_end(ended, "", lost)
    first = "Stopped by a fault: the host lost 30 ticks"
    assert capsys.readouterr().err.strip().startswith(first)

    def no_results(run: Path) -> None:
        raise RunError("no row is whole")

    monkeypatch.setattr("rig.kinds.oswec_bench.products.analyse", no_results)
    done = rig("show", run)
    assert done.returncode != 0
    assert first in done.stderr
    assert done.stderr.endswith("no row is whole\n")
    assert "\nRecord complete.\n" in done.stderr
    outcome.status = "complete"
    assert lost_ticks(ended) is None
