"""`rig bench SESSION`."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from rig import cli
from rig.cli.command_error import fail
from rig.cli.input_files import SESSIONS, input_file, rig_file
from rig.cli.run_end import exit_code, print_folder, row_as_json
from rig.cli.session_progress import SessionProgress
from rig.config.shipped_files import UnknownNameError
from rig.execution.task import RunResult, run_task
from rig.kinds.oswec_bench.rehearsal.job import problems
from rig.kinds.oswec_bench.sessions import Session, SessionReport, check_session
from rig.kinds.oswec_bench.tasks import rehearsal_mode, session_task, wired_mode
from rig.processes.run_types import ExecutionMode
from rig.recording.runs import RunError, create
from rig.wires.job import WiringError

if TYPE_CHECKING:
    from rig.analysis.stop_reason import LostTicks


class BenchOptions(NamedTuple):
    """Options of `rig bench` apart from the session file."""

    rig: Path | None  # replaces the rig file of the session
    realtime: bool
    emulated: bool  # --sim


def examine_session(path: Path, rig: Path | None = None) -> SessionReport:
    """Check a session and all its input files, the simulated bench included.

    ``rig`` replaces the rig that the session names.
    """
    return check_session(path, further_check=problems, rig=rig)


def main(path: Path, runs: Path, options: BenchOptions, *, as_json: bool) -> int:
    """Check, run and analyse a session, print the result, and return the exit code."""
    try:
        report = examine_session(input_file(path, SESSIONS), rig_file(options.rig))
    except UnknownNameError as error:
        return fail("bench", error, as_json=as_json)
    if report.session is None or report.plan is None:
        return print_errors(report, as_json=as_json)
    session, plan = report.session, report.plan
    try:
        mode = _execution_mode(session, options)
    except WiringError as error:
        return fail("bench", error, as_json=as_json, code=cli.BAD_INPUT)
    title = f"{session.file.name} on {session.rig.name}"
    try:
        with SessionProgress(title, mode.name, plan, quiet=as_json) as view:
            ended = run_task(session_task(session, plan), runs, view, mode)
    except (create.BusyError, OSError, RunError) as error:
        return fail("bench", error, as_json=as_json, code=cli.FAILED)
    results, products, summary_text, trouble = _analyse(ended, quiet=as_json)
    lost = _lost_ticks(ended)
    create.write_rows_done(ended.folder, _rows_done(ended, len(plan.rows)))
    trouble = "; ".join(filter(None, (ended.save_error, trouble)))
    if as_json:
        outcome = ended.outcome
        record = {
            **outcome._asdict(),
            "last_row": row_as_json(outcome.last_row, ended.reasons),
            "results": results,
            "lost_ticks": lost and lost._asdict(),
            "folder": str(ended.folder),
            "products": [str(product) for product in products],
            "trouble": trouble,
        }
        print(json.dumps(record))
    else:
        _print_result(ended, summary_text, lost)
        print_folder(ended, products, trouble)
    return exit_code(ended.outcome, trouble)


def _execution_mode(session: Session, options: BenchOptions) -> ExecutionMode:
    """Return the execution mode.

    A bench with wiring runs on its devices or, with --sim, on emulated devices. A bench without
    wiring runs as a rehearsal.
    """
    if session.rig.wiring is None:
        if options.emulated:
            raise WiringError(
                f"{session.rig.name} has no wiring, so no devices can be emulated; leave out --sim"
            )
        return rehearsal_mode(session, real_clock=options.realtime)
    return wired_mode(session, emulated=options.emulated)


def print_errors(report: SessionReport, *, as_json: bool) -> int:
    """Print why a session cannot run, and return the exit code."""
    if as_json:
        print(json.dumps({"status": "bad input"} | json.loads(report.to_json())))
    else:
        print(report.text())
    return cli.BAD_INPUT


def show(report: SessionReport, *, as_json: bool) -> int:
    """Print a report as `rig check` does, and return the exit code (0: the session can run)."""
    print(report.to_json() if as_json else report.text())
    return cli.OK if report.ok else cli.BAD_INPUT


def _analyse(ended: RunResult, *, quiet: bool) -> tuple[dict[str, Any], list[Path], str, str]:
    """Return the results, the written files, the summary text and the reason for no results.

    A run without a tick has no results and needs no reason. For a run that stopped early, the
    summary text explains why there are no results.
    """
    from rig.kinds.oswec_bench.products.analyse import analyse

    outcome = ended.outcome
    if outcome.ticks == 0:
        return {}, [], "", ""
    if not quiet:
        print("analysing the session ...", file=sys.stderr, flush=True)
    try:
        summary = analyse(ended.folder)
    except (RunError, OSError, ValueError) as error:
        failure = f"no results: {error}" if outcome.status == "complete" else ""
        return {}, [], "" if failure else f"no results: {error}", failure
    return summary.as_dict(), list(summary.files), summary.as_text(), ""


def _rows_done(ended: RunResult, rows_planned: int) -> int:
    """Return the number of finished rows: all, or those before the row in which the run stopped."""
    if ended.outcome.status == "complete":
        return rows_planned
    return max(0, int(ended.outcome.last_row.get("plan.row", 0)))


def _lost_ticks(ended: RunResult) -> "LostTicks | None":
    """Return the ticks that the host lost before a trip, where they may be its cause."""
    from rig.analysis.stop_reason import find_stop

    try:
        return find_stop(ended.folder, {"status": ended.outcome.status}).lost
    except (RunError, OSError):
        return None  # the analysis has already reported the error in the record


def _print_result(ended: RunResult, summary_text: str, lost: "LostTicks | None") -> None:
    from rig.analysis.stop_reason import describe_ending

    outcome = ended.outcome
    status = {
        "status": outcome.status,
        "reason": outcome.reason,
        "reason_text": ended.reasons.text(outcome.reason),
    }
    if summary_text:
        print(summary_text)
    ending = describe_ending(status, lost).description
    already_printed = ending in summary_text and sys.stdout.isatty()  # not twice on one screen
    if outcome.status != "complete" and not already_printed:
        print(f"\n{ending}.", file=sys.stderr)
