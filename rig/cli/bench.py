"""`rig bench SESSION`."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rig import cli
from rig.cli.command_error import fail
from rig.cli.run_end import exit_code, in_words, tell_folder
from rig.cli.session_progress import SessionProgress
from rig.execution.hardware.job import WiringError
from rig.execution.rehearsal.bench_job import problems_of_session
from rig.execution.session import rehearsal, task_of, wired
from rig.execution.task import Ended, ExecutionMode, carry_out_task
from rig.planning.session import Session, SessionReport, check_session
from rig.recording.runs import RunError, create

if TYPE_CHECKING:
    from rig.analysis.stop_reason import LostTicks


class BenchOptions(NamedTuple):
    """What the command line asks for beside the session."""

    rig: Path | None  # in place of the session's own
    realtime: bool
    emulated: bool  # --sim


def examine_session(path: Path, rig: Path | None = None) -> SessionReport:
    """Check a session with all it stands on, the simulated bench included.

    ``rig`` stands in for the rig that the session names.
    """
    return check_session(path, further_check=problems_of_session, rig=rig)


def main(path: Path, runs: Path, wanted: BenchOptions, *, as_json: bool) -> int:
    """Check, run, analyse, and say how it went; gives the exit code."""
    report = examine_session(path, wanted.rig)
    if report.session is None or report.plan is None:
        return complain(report, as_json=as_json)
    session, plan = report.session, report.plan
    try:
        mode = _mode(session, wanted)
    except WiringError as error:
        return fail("bench", error, as_json=as_json, code=cli.BAD_INPUT)
    title = f"{session.file.name} on {session.rig.name}"
    try:
        with SessionProgress(title, mode.name, plan, quiet=as_json) as view:
            ended = carry_out_task(task_of(session, plan), runs, view, mode)
    except (create.BusyError, OSError, RunError) as error:
        return fail("bench", error, as_json=as_json, code=cli.FAILED)
    found, products, text, trouble = _analyse(ended, quiet=as_json)
    lost = _lost_ticks(ended)
    create.note_rows(ended.folder, _rows_done(ended, len(plan.rows)))
    trouble = "; ".join(filter(None, (ended.trouble, trouble)))
    if as_json:
        outcome = ended.outcome
        told = {
            **outcome._asdict(),
            "last_row": in_words(outcome.last_row),
            "found": found,
            "lost_ticks": lost and lost._asdict(),
            "folder": str(ended.folder),
            "products": [str(product) for product in products],
            "trouble": trouble,
        }
        print(json.dumps(told))
    else:
        _tell(ended, text, lost)
        tell_folder(ended, products, trouble)
    return exit_code(ended.outcome, trouble)


def _mode(session: Session, wanted: BenchOptions) -> ExecutionMode:
    """On what to run: a bench with wires is run on them, or, with --sim, on emulated devices."""
    if session.rig.wiring is None:
        if wanted.emulated:
            raise WiringError(f"{session.rig.name} has no wiring to hang emulated devices on")
        return rehearsal(session, real_clock=wanted.realtime)
    return wired(session, emulated=wanted.emulated)


def complain(report: SessionReport, *, as_json: bool) -> int:
    """Say why a session cannot be run."""
    if as_json:
        print(json.dumps({"status": "bad input"} | json.loads(report.to_json())))
    else:
        print(report.text())
    return cli.BAD_INPUT


def show(report: SessionReport, *, as_json: bool) -> int:
    """Print a report, as `rig check` does; 0 if the session can be run."""
    print(report.to_json() if as_json else report.text())
    return cli.OK if report.ok else cli.BAD_INPUT


def _analyse(ended: Ended, *, quiet: bool) -> tuple[dict[str, Any], list[Path], str, str]:
    """What the session found, its files, both in words and, if there is nothing, why.

    A run without a tick has nothing and needs no reason; nor has one that stopped early.
    """
    from rig.analysis.session.analyse import analyse

    outcome = ended.outcome
    if outcome.ticks == 0:
        return {}, [], "", ""
    if not quiet:
        print("analysing the session ...", file=sys.stderr, flush=True)
    try:
        summary = analyse(ended.folder)
    except (RunError, OSError, ValueError) as error:
        trouble = f"no results: {error}" if outcome.status == "complete" else ""
        return {}, [], "" if trouble else f"no results: {error}", trouble
    return summary.as_dict(), list(summary.files), summary.as_text(), ""


def _rows_done(ended: Ended, planned: int) -> int:
    """Rows that were walked to their end: all, or those before the one the run stopped in."""
    if ended.outcome.status == "complete":
        return planned
    return max(0, int(ended.outcome.last_row.get("plan.row", 0)))


def _lost_ticks(ended: Ended) -> "LostTicks | None":
    """What the host lost before the rig tripped, where that may be the cause."""
    from rig.analysis.stop_reason import stop_of

    try:
        return stop_of(ended.folder, {"status": ended.outcome.status}).lost
    except (RunError, OSError):
        return None  # the analysis has said what is wrong with the record


def _tell(ended: Ended, text: str, lost: "LostTicks | None") -> None:
    from rig.analysis.stop_reason import ending_of

    outcome = ended.outcome
    if text:
        print(text)
    ending = ending_of({"status": outcome.status, "reason": outcome.reason}, lost).description
    told = ending in text and sys.stdout.isatty()  # not twice on one screen
    if outcome.status != "complete" and not told:
        print(f"\n{ending}.", file=sys.stderr)
