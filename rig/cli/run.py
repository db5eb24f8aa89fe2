"""`rig run FILE`: run a campaign or session to its end, and analyse it."""

import math
import sys
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from rig.analysis.stop_reason import LostTicks, describe_ending
from rig.api.campaign_run import (
    CampaignRun,
    CompletedRun,
    Feedback,
    RunOptions,
    find_rehearsal,
    open_task,
)
from rig.campaign import CheckReport
from rig.cli.check import print_problems, with_simulated_rows
from rig.cli.input_files import CAMPAIGNS, SESSIONS, input_file, rig_file
from rig.cli.options import RUNS, TASK_HELP, Interpreted, Json, Realtime, Rig, Runs, Sim, WithPage
from rig.cli.output import (
    FAILED,
    FAULT,
    INPUT_ERRORS,
    LOST,
    OK,
    STOPPED,
    fail,
    input_errors,
    print_json,
)
from rig.cli.run_panel import RunPanel
from rig.config.problems import Problem
from rig.config.wiring import WiringError
from rig.execution.task import RunResult
from rig.host import disk
from rig.kinds.interface import Report
from rig.kinds.registry import RigKind
from rig.presentation.value_labels import ENUMERATIONS, REASON, flag_type
from rig.processes.run_types import Outcome
from rig.realtime.reasons import ReasonTable
from rig.recording.runs import RunError, create

EXIT_CODES = """\
Exit codes: 0 complete; 1 failed, or refused because the host did not grant what the rig \
requires; 2 bad input; 3 stopped by the operator or for want of one, or Ctrl-C ended the drawing; \
4 the rig tripped; 5 a process died or rows were lost."""
_MAX_WARNINGS = 5
_EXIT_CODES = {"complete": OK, "stopped": STOPPED, "fault": FAULT}


def command(
    task: Annotated[Path | None, typer.Argument(metavar="FILE", help=TASK_HELP)] = None,
    realtime: Realtime = False,
    rig: Rig = None,
    sim: Sim = False,
    interpreted: Interpreted = False,
    arm: Annotated[
        bool, typer.Option("--arm", help="Switch power on only when an operator has armed the run.")
    ] = False,
    page: WithPage = False,
    resume: Annotated[
        Path | None,
        typer.Option(
            "--resume",
            metavar="RUN",
            help="Go on with a campaign that ended early: measure the rows that it lacks, in the"
            " same run. FILE may be left out.",
        ),
    ] = None,
    accept_changes: Annotated[
        bool,
        typer.Option(
            "--accept-changes",
            help="With --resume: go on although files have changed; the record names the changes.",
        ),
    ] = False,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Run a campaign or session, and analyse it.

    The rig file decides the kind of rig. A rig file without wiring runs as a
    rehearsal on the simulated plant. A rig file with wiring runs on the rig's
    devices.
    """
    options = RunOptions(
        rig, realtime, sim, interpreted, arm, page=page, accept_changes=accept_changes
    )
    if resume is not None:
        from rig.cli.resume import named_files

        try:
            run, task, rig = named_files(resume, runs, task, rig)
        except (create.BusyError, *INPUT_ERRORS) as error:
            return fail("run", error, as_json=as_json)
        options = options._replace(resume=run, rig=rig)
    if task is None or (accept_changes and resume is None):
        missing = ValueError("give a FILE, or --resume RUN (which --accept-changes needs)")
        return fail("run", missing, as_json=as_json)
    return run_named("run", task, runs, options, as_json=as_json)


def run_named(
    command_name: str,
    name: Path,
    runs: Path,
    options: RunOptions,
    *,
    as_json: bool,
    folders: tuple[str, ...] = (CAMPAIGNS, SESSIONS),
    kind: RigKind | None = None,
) -> int:
    """Run the campaign or session that a person names, and return the exit code.

    ``folders`` are those of the shipped files to search; ``kind``: the kind of rig that it must
    have, else that of its rig file.
    """
    with input_errors(command_name, as_json=as_json):
        path, rig = input_file(name, *folders), rig_file(options.rig)
        options = options._replace(rig=rig)
        opened = open_task(path, rig, kind)
    report = opened.report
    checked, plan = report.checked, report.plan
    if checked is None or plan is None:
        return print_problems(report, as_json=as_json)
    plan_record: Mapping[str, Any] = {}
    resumed = options.resume
    if resumed is not None:
        from rig.cli.resume import is_emulated, rest_of_run, with_recorded_start

        with input_errors(command_name, as_json=as_json):
            wired = checked.rig.wiring is not None
            emulated = is_emulated(resumed, wired=wired, sim=options.emulated)
            options = options._replace(emulated=emulated)
            rest = rest_of_run(report, resumed, accept_changes=options.accept_changes)
            plan, plan_record = rest.plan, rest.plan_record
            report = with_recorded_start(report, resumed)
    if isinstance(report, CheckReport) and options.manual is None:
        wired = checked.rig.wiring is not None  # a rehearsal finds a trip by itself
        if wired or report.unpredicted:
            report = with_simulated_rows(report, quiet=as_json)
        if wired and report.refused:
            return print_problems(CheckReport(path, report.refused, None, None), as_json=as_json)
    opened = opened._replace(report=report)
    with input_errors(command_name, as_json=as_json):
        rehearsed = find_rehearsal(opened.campaign, runs, options, _notice)
    if not as_json:
        print_warnings(() if options.manual else report.warnings, path)
        # A full disk stops the rig.
        if shortage := disk.space_shortage(runs, plan.duration, 1.0 / plan.dt):
            print(f"warning: {shortage}", file=sys.stderr)
    feedback = Feedback(
        partial(RunPanel, quiet=as_json), _notice, (lambda text: None) if as_json else _notice
    )
    try:
        with input_errors(command_name, as_json=as_json):
            run = CampaignRun(opened, runs, options, feedback, rehearsed)
        done = run.execute(plan, plan_record)
    except WiringError as error:
        return fail(command_name, error, as_json=as_json)
    except (create.BusyError, OSError, RunError) as error:
        return fail(command_name, error, as_json=as_json, code=FAILED)
    if as_json:
        print_json(_as_json(done, report))
    else:
        print_end(done.ended, done.products.text, done.lost)
        _print_folder(done.ended, done.products.files, done.trouble)
    return exit_code(done.ended.outcome, done.failed, interrupted=bool(done.products.interrupted))


def _notice(text: str) -> None:
    print(text, file=sys.stderr, flush=True)


def _as_json(done: CompletedRun, report: Report) -> dict[str, Any]:
    """Return the run and its results as JSON values."""
    return {
        **done.ended.outcome._asdict(),
        "last_row": row_as_json(done.ended.outcome.last_row, done.ended.reasons),
        **done.products.results,
        "lost_ticks": done.lost and done.lost._asdict(),
        "folder": str(done.ended.folder),
        "products": [str(file) for file in done.products.files],
        "trouble": done.trouble,
        "warnings": [warning.as_dict() for warning in report.warnings],
    }


def print_warnings(warnings: tuple[Problem, ...], path: Path) -> None:
    """Print the warnings of `rig check`, for an operator who did not run it before."""
    for warning in warnings[:_MAX_WARNINGS]:
        print(f"warning: {warning.text()}", file=sys.stderr)
    if len(warnings) > _MAX_WARNINGS:
        remaining = len(warnings) - _MAX_WARNINGS
        print(f"and {remaining} more warnings; rig check {path} lists all", file=sys.stderr)


def exit_code(outcome: Outcome, trouble: str, *, interrupted: bool = False) -> int:
    """Return the command's exit code.

    ``trouble`` is a failure after the run (empty: none); ``interrupted``: Ctrl-C ended the drawing.
    """
    if outcome.status == "crashed" or outcome.died or outcome.dropped or outcome.unsaved:
        return LOST
    if trouble or outcome.status == "refused" or (outcome.moved and outcome.status == "complete"):
        return FAILED
    if interrupted and outcome.status == "complete":
        return STOPPED
    return _EXIT_CODES[outcome.status]


def row_as_json(row: dict[str, float | int], reasons: ReasonTable) -> dict[str, Any]:
    """Return a row as JSON values.

    Coded numbers become names, flags become lists of names, NaN and infinity become null.
    """
    values: dict[str, Any] = {}
    for name, value in row.items():
        if name == REASON:
            values[name] = reasons.name(int(value)) if int(value) in reasons else value
        elif name in ENUMERATIONS:
            values[name] = {int(code): code.name for code in ENUMERATIONS[name]}.get(
                int(value), value
            )
        elif flags := flag_type(name):
            values[name] = [flag.name for flag in flags if int(value) & flag]
        else:
            values[name] = value if math.isfinite(value) else None
    return values


def print_end(ended: RunResult, summary: str, lost: LostTicks | None) -> None:
    """Print the summary, and on standard error how the run ended, but not twice on one screen."""
    outcome = ended.outcome
    status = {
        "status": outcome.status,
        "reason": outcome.reason,
        "reason_text": ended.reasons.text(outcome.reason),
    }
    ending = describe_ending(status, lost, ended.reasons)
    if summary:
        print(summary)
    already_printed = ending.description in summary and (
        sys.stdout.isatty() or outcome.status not in ("crashed", "refused")
    )
    if not already_printed:
        print("\n".join([f"\n{ending.description}.", *ending.hints]), file=sys.stderr)


def _print_folder(ended: RunResult, products: tuple[Path, ...], trouble: str) -> None:
    """Print lost rows, the messages of the run, and the paths of folder and products."""
    outcome = ended.outcome
    if outcome.dropped or outcome.unsaved:
        lost = f"{outcome.dropped} rows dropped, {outcome.unsaved} rows not saved"
        print(f"\nlost: {lost}", file=sys.stderr)
    for message in (*outcome.messages, outcome.died, outcome.moved, trouble):
        if message:
            print(f"\n{message}", file=sys.stderr)
    print(f"\n{ended.folder}/")
    for product in products:
        print(f"  {product.name}")
