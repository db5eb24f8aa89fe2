"""`rig run CAMPAIGN`."""

import json
import sys
from pathlib import Path
from typing import Any, NamedTuple

from rig import cli
from rig.cli import command_error
from rig.cli.check import examine, print_errors
from rig.cli.command_error import fail
from rig.cli.input_files import CAMPAIGNS, input_file, rig_file
from rig.cli.progress import Progress
from rig.cli.run_end import exit_code, print_folder, row_as_json
from rig.config.problems import Problem
from rig.config.shipped_files import UnknownNameError
from rig.execution.campaign import run_campaign
from rig.execution.task import RunResult
from rig.kinds.wavebot.campaign import Campaign, Plan
from rig.kinds.wavebot.tasks import rehearsal_mode, wired_mode
from rig.processes.run_types import ExecutionMode
from rig.recording.runs import RunError, create
from rig.wires.job import WiringError

_MAX_WARNINGS = 5


class RunOptions(NamedTuple):
    """Options of `rig run` apart from the campaign file."""

    rig: Path | None  # replaces the rig file of the campaign
    realtime: bool
    emulated: bool  # --sim


def main(path: Path, runs: Path, options: RunOptions, *, as_json: bool) -> int:
    """Check, run and analyse a campaign, print the result, and return the exit code."""
    try:
        report = examine(input_file(path, CAMPAIGNS), rig_file(options.rig))
    except UnknownNameError as error:
        return fail("run", error, as_json=as_json)
    if report.campaign is None or report.plan is None:
        return print_errors(report, as_json=as_json)
    campaign, plan = report.campaign, report.plan
    warnings = report.warnings
    if not as_json:
        _print_warnings(warnings, path)
        _warn_of_disk_space(runs, plan)
    title = f"{campaign.file.name} on {campaign.rig.name}"
    try:
        mode = _execution_mode(campaign, options)
    except WiringError as error:
        return fail("run", error, as_json=as_json, code=cli.BAD_INPUT)
    try:
        with Progress(title, mode.name, plan, quiet=as_json) as view:
            ended = run_campaign(campaign, plan, runs, view, mode)
    except (create.BusyError, OSError, RunError) as error:
        return fail("run", error, as_json=as_json, code=cli.FAILED)
    products, summary, trouble = _analyse(ended, quiet=as_json)
    trouble = "; ".join(filter(None, (ended.save_error, trouble)))
    outcome = ended.outcome
    if as_json:
        print(
            json.dumps(
                {
                    **outcome._asdict(),
                    "last_row": row_as_json(outcome.last_row, ended.reasons),
                    "optima": summary.get("optima", []),
                    "lost_ticks": summary.get("lost_ticks"),
                    "folder": str(ended.folder),
                    "products": [str(product) for product in products],
                    "trouble": trouble,
                    "warnings": [warning.as_dict() for warning in warnings],
                }
            )
        )
    else:
        _print_result(ended, summary, products, trouble)
    return exit_code(outcome, trouble)


def _print_warnings(warnings: tuple[Problem, ...], path: Path) -> None:
    """Print the warnings of `rig check`, for an operator who did not run it before."""
    for warning in warnings[:_MAX_WARNINGS]:
        print(f"warning: {warning.text()}", file=sys.stderr)
    if len(warnings) > _MAX_WARNINGS:
        remaining = len(warnings) - _MAX_WARNINGS
        print(f"and {remaining} more warnings; rig check {path} lists all", file=sys.stderr)


def _warn_of_disk_space(runs: Path, plan: Plan) -> None:
    """Warn before the run if the disk may be too small: a full disk stops the rig."""
    from rig.host import disk

    if shortage := disk.space_shortage(runs, plan.duration, 1.0 / plan.dt):
        print(f"warning: {shortage}", file=sys.stderr)


def _execution_mode(campaign: Campaign, options: RunOptions) -> ExecutionMode:
    """Return the execution mode.

    A rig with wiring runs on its devices or, with --sim, on emulated devices. A rig without wiring
    runs as a rehearsal.
    """
    if campaign.rig.wiring is None:
        if options.emulated:
            raise WiringError(
                f"{campaign.rig.name} has no wiring, so no devices can be emulated; leave out --sim"
            )
        return rehearsal_mode(campaign, real_clock=options.realtime)
    return wired_mode(campaign, emulated=options.emulated)


def _analyse(ended: RunResult, *, quiet: bool) -> tuple[list[Path], dict[str, Any], str]:
    """Return the run's products, its summary as in `rig show --json`, and the trouble.

    The trouble states why products are missing. A run without a tick has no products and no
    trouble.
    """
    from rig.analysis.report import write_products

    if ended.outcome.ticks == 0:
        return [], {}, ""
    if not quiet:
        print("drawing surfaces and summary ...", file=sys.stderr, flush=True)
    products: list[Path] = []
    summary: dict[str, Any] = {}
    try:
        products = write_products(ended.folder)
        summary = json.loads((ended.folder / "summary.json").read_text())
        create.write_rows_done(ended.folder, summary["rows_done"])
    except (RunError, OSError, ValueError) as error:
        message = command_error.error_text(error)
        return products, summary, message if products else f"could not make all products: {message}"
    except KeyboardInterrupt:
        message = f"interrupted; `rig plot {ended.folder}` draws surfaces and summary"
        return products, summary, message
    return products, summary, ""


def _print_result(
    ended: RunResult, summary: dict[str, Any], products: list[Path], failure: str
) -> None:
    from rig.analysis.stop_reason import ENDINGS

    summary_file = ended.folder / "summary.txt"
    if summary_file.exists():
        print(summary_file.read_text().rstrip())
    outcome = ended.outcome
    # The summary on standard output states the ending, too: do not print it twice on one screen.
    already_printed = summary_file.exists() and (
        sys.stdout.isatty() or outcome.status not in ("crashed", "refused")
    )
    if not already_printed:
        ending = ENDINGS.get(outcome.status, outcome.status)
        reason = summary.get("reason") or ended.reasons.text(outcome.reason)
        print(f"\n{ending}: {reason}.", file=sys.stderr)
    print_folder(ended, products, failure)
