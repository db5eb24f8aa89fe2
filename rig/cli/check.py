"""`rig check FILE`."""

import json
import sys
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Any

import typer

from rig.api.campaign_run import open_task
from rig.campaign import CheckReport
from rig.cli.input_files import CAMPAIGNS, SESSIONS, input_file, rig_file
from rig.cli.options import RUNS, TASK_HELP, Json, Rig, Runs
from rig.cli.output import BAD_INPUT, OK, fail, input_errors, print_json
from rig.config.wiring import WiringError
from rig.host import disk
from rig.interop.export_size import format_bytes
from rig.kinds.interface import Report, Tasks
from rig.presentation.console import table_console


def command(
    task: Annotated[Path, typer.Argument(metavar="FILE", help=TASK_HELP)],
    rows: Annotated[
        bool, typer.Option("--rows", help="Show every row, not only those nearest to a limit.")
    ] = False,
    simulate: Annotated[
        bool,
        typer.Option("--simulate", help="Simulate all rows; compile the rig's loop if necessary."),
    ] = False,
    scatter: Annotated[
        float | None,
        typer.Option(
            min=0,
            help="Scatter of the mean power of a wave period, W, that is assumed for the expected "
            "duration; with --simulate.",
        ),
    ] = None,
    rig: Rig = None,
    runs: Runs = RUNS,
    as_json: Json = False,
) -> int:
    """Check a campaign or session: list every error, or describe the planned run.

    For a campaign, the report also predicts motion, current and power of
    each row. Where its law or its kind of rig has no such prediction, the
    report simulates the rows, if their loop is compiled on this host.
    It estimates the size of the log, and warns if the disk of the folder of
    runs has less room.
    """
    with input_errors("check", as_json=as_json):
        path, rig = input_file(task, CAMPAIGNS, SESSIONS), rig_file(rig)
        opened = open_task(path, rig)
    report, tasks = opened.report, opened.tasks
    if simulate and not isinstance(report, CheckReport):
        error = ValueError(
            "--simulate is for the rows of a campaign; rig sweep simulates a session"
        )
        return fail("check", error, as_json=as_json)
    if isinstance(report, CheckReport):
        report = with_simulated_rows(report, simulate=simulate, quiet=as_json)
    if scatter is not None and isinstance(report, CheckReport):
        report = report._replace(scatter_w=scatter)
        with input_errors("check", as_json=as_json):
            _ = report.expected
    refusal = _wire_refusal(tasks, report)
    size = _log_bytes(tasks, report)
    log = "" if size is None else f"about {format_bytes(float(f'{size:.2g}'))} of log"
    if as_json:
        refused = {"ok": False, "status": "bad input", "message": str(refusal)} if refusal else {}
        disk_values = {} if size is None else {"log_bytes": round(size)}
        print_json(json.loads(report.to_json()) | disk_values | refused)
    else:
        if isinstance(report, CheckReport):
            report = report._replace(disk=log)
        opened.display.show_report(report, every_row=rows)
        if log and not isinstance(report, CheckReport):
            print(f"{'disk':11} {log}")
        if isinstance(report, CheckReport) and report.simulated is not None:
            report.simulated.show(every_row=rows)
        _warn_of_full_disk(size, runs)
        if refusal:
            fail("check", refusal, as_json=False)
        show_verdict(report, can_run=report.ok and not refusal)
    return OK if report.ok and not refusal else BAD_INPUT


def show_verdict(report: Report, *, can_run: bool) -> None:
    """Print whether the campaign or session can be run."""
    console, noun = table_console(), "campaign" if isinstance(report, CheckReport) else "session"
    if can_run:
        console.print(f"the {noun} can be run", style="bold green")
    else:
        console.print(f"the {noun} cannot be run", style="bold red")


def with_simulated_rows(
    report: CheckReport, *, simulate: bool = False, quiet: bool = True
) -> CheckReport:
    """Return the report of a campaign with its simulated rows, if it needs any.

    ``simulate``: of all rows in any case; compile their loop if necessary.
    """
    if report.plan is None or (report.prediction is not None and not simulate):
        return report
    from rig.cli.sweep import ProgressBar, compile_loop
    from rig.sweeps import simulated_check

    count = len(report.plan.rows)
    with ProgressBar("simulating", count, quiet=quiet) as bar:
        return simulated_check.with_simulated_rows(
            report,
            compile_loop if simulate else None,
            lambda done: bar.show(done, f"simulated {done} of {count} rows"),
        )


def _log_bytes(tasks: Tasks, report: Report) -> float | None:
    """Return the expected size of the log; None with problems."""
    if report.checked is None or report.plan is None:
        return None
    task = tasks.execution_task(report.checked, report.plan)
    seconds = report.duration if isinstance(report, CheckReport) else report.plan.duration
    return disk.log_bytes(task.kind.row_type, seconds / task.dt)


def _warn_of_full_disk(size: float | None, runs: Path) -> None:
    """Print a warning where the disk of the folder of runs has less room than the log needs."""
    if size is None:
        return
    with suppress(OSError):  # creating the run's folder reports the error
        if (free := disk.free_bytes(runs)) < size:
            text = f"the log needs {format_bytes(size)}, {format_bytes(free)} are free"
            place = f"{text} in {runs.absolute()}; --runs names a folder on another disk"
            print(f"warning: {place}", file=sys.stderr)


def _wire_refusal(tasks: Tasks, report: Report) -> WiringError | None:
    """Return why the rig's wires cannot carry its signals at its rate; None if they can."""
    checked: Any = report.checked
    if isinstance(report, CheckReport) and report.prediction is not None:
        checked = report.prediction.campaign  # also of a campaign whose rows are refused
    if checked is None or checked.rig.wiring is None:
        return None
    try:
        tasks.wired_mode(checked, emulated=False)
    except WiringError as error:
        rig = checked.rig
        place = f"{rig.name} at rate_hz = {rig.rate_hz}"
        return WiringError(f"the wires cannot carry it: {place}: {error}")
    return None


def print_problems(report: Report, *, as_json: bool) -> int:
    """Print why a campaign or session cannot run, and return the exit code."""
    if as_json:
        print(json.dumps({"status": "bad input"} | json.loads(report.to_json())))
    else:
        print(report.text())
    return BAD_INPUT
