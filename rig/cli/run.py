"""`rig run CAMPAIGN`."""

import json
import sys
from pathlib import Path
from typing import Any, NamedTuple

from rig import cli
from rig.cli import command_error
from rig.cli.check import complain, examine
from rig.cli.command_error import fail
from rig.cli.progress import Progress
from rig.cli.run_end import exit_code, in_words, tell_folder
from rig.config.problems import Problem
from rig.execution.campaign import carry_out, rehearsal, wired
from rig.execution.hardware.job import WiringError
from rig.execution.task import Ended, ExecutionMode
from rig.planning.campaign import Campaign, Plan
from rig.recording.runs import RunError, create

_MOST_WARNINGS = 5


class RunOptions(NamedTuple):
    """What the command line asks for beside the campaign."""

    rig: Path | None  # in place of the campaign's own
    realtime: bool
    emulated: bool  # --sim


def main(path: Path, runs: Path, wanted: RunOptions, *, as_json: bool) -> int:
    """Check, run, analyse, and say how it went; gives the exit code."""
    report = examine(path, wanted.rig)
    if report.campaign is None or report.plan is None:
        return complain(report, as_json=as_json)
    campaign, plan = report.campaign, report.plan
    warnings = report.warnings
    if not as_json:
        _warn(warnings, path)
        _warn_of_room(runs, plan)
    title = f"{campaign.file.name} on {campaign.rig.name}"
    try:
        mode = _mode(campaign, wanted)
    except WiringError as error:
        return fail("run", error, as_json=as_json, code=cli.BAD_INPUT)
    try:
        with Progress(title, mode.name, plan, quiet=as_json) as view:
            ended = carry_out(campaign, plan, runs, view, mode)
    except (create.BusyError, OSError, RunError) as error:
        return fail("run", error, as_json=as_json, code=cli.FAILED)
    products, summary, trouble = _analyse(ended, quiet=as_json)
    trouble = "; ".join(filter(None, (ended.trouble, trouble)))
    outcome = ended.outcome
    if as_json:
        print(
            json.dumps(
                {
                    **outcome._asdict(),
                    "last_row": in_words(outcome.last_row),
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
        _tell(ended, summary, products, trouble)
    return exit_code(outcome, trouble)


def _warn(warnings: tuple[Problem, ...], path: Path) -> None:
    """What `rig check` warns of, for who did not ask it before."""
    for warning in warnings[:_MOST_WARNINGS]:
        print(f"warning: {warning.text()}", file=sys.stderr)
    if len(warnings) > _MOST_WARNINGS:
        left = len(warnings) - _MOST_WARNINGS
        print(f"and {left} more warnings; rig check {path} says all", file=sys.stderr)


def _warn_of_room(runs: Path, plan: Plan) -> None:
    """A full disk stops the rig: better known before the waves than in the last row."""
    from rig.host import disk

    if short := disk.shortage(runs, plan.duration, 1.0 / plan.dt):
        print(f"warning: {short}", file=sys.stderr)


def _mode(campaign: Campaign, wanted: RunOptions) -> ExecutionMode:
    """On what to run: a rig with wires is run on them, or, with --sim, on emulated devices."""
    if campaign.rig.wiring is None:
        if wanted.emulated:
            raise WiringError(f"{campaign.rig.name} has no wiring to hang emulated devices on")
        return rehearsal(campaign, real_clock=wanted.realtime)
    return wired(campaign, emulated=wanted.emulated)


def _analyse(ended: Ended, *, quiet: bool) -> tuple[list[Path], dict[str, Any], str]:
    """The run's products, its summary as `rig show --json` has it and, if there is none, why.

    A run without a tick has none and needs no reason.
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
        create.note_rows(ended.folder, summary["rows_done"])
    except (RunError, OSError, ValueError) as error:
        said = command_error.in_words(error)
        return products, summary, said if products else f"not all products are made: {said}"
    except KeyboardInterrupt:
        again = f"interrupted; `rig plot {ended.folder}` makes surfaces and summary"
        return products, summary, again
    return products, summary, ""


def _tell(ended: Ended, summary: dict[str, Any], products: list[Path], trouble: str) -> None:
    from rig.analysis import phrases
    from rig.analysis.stop_reason import ENDINGS

    text = ended.folder / "summary.txt"
    if text.exists():
        print(text.read_text().rstrip())
    outcome = ended.outcome
    # The page says it too, but to standard output: not twice on one screen.
    told = text.exists() and (sys.stdout.isatty() or outcome.status not in ("crashed", "refused"))
    if not told:
        ending = ENDINGS.get(outcome.status, outcome.status)
        reason = summary.get("reason") or phrases.reason_text(outcome.reason)
        print(f"\n{ending}: {reason}.", file=sys.stderr)
    tell_folder(ended, products, trouble)
