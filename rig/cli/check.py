"""`rig check FILE`."""

import json
import sys
from collections.abc import Iterable
from datetime import UTC, date, datetime
from pathlib import Path
from typing import Annotated, Any

import typer

from rig.campaign import AnyCampaign
from rig.cli.input_files import CAMPAIGNS, SESSIONS, input_file, rig_file
from rig.cli.options import TASK_HELP, Json, Rig
from rig.cli.output import BAD_INPUT, OK, input_errors
from rig.config.problems import Problem
from rig.kinds.interface import Display, Report, Tasks
from rig.kinds.rig_file import kind_of_task


def command(
    task: Annotated[Path, typer.Argument(metavar="FILE", help=TASK_HELP)],
    rows: Annotated[
        bool, typer.Option("--rows", help="Show every row, not only those nearest to a limit.")
    ] = False,
    rig: Rig = None,
    as_json: Json = False,
) -> int:
    """Check a campaign or session: list every error, or describe the planned run.

    For a campaign, the report also predicts motion, current and power of
    each row.
    """
    with input_errors("check", as_json=as_json):
        path, rig = input_file(task, CAMPAIGNS, SESSIONS), rig_file(rig)
        kind = kind_of_task(path, rig)
        tasks: Tasks = kind.room("tasks")
        display: Display = kind.room("display")
    report = examine(tasks, path, rig)
    if as_json:
        print(report.to_json())
    else:
        display.show_report(report, every_row=rows)
    return OK if report.ok else BAD_INPUT


def examine(tasks: Tasks, path: Path, rig: Path | None) -> Report:
    """Return the whole report on a campaign or session that is to run today (UTC)."""
    return tasks.examine(path, rig, day=datetime.now(UTC).date())


def print_problems(report: Report, *, as_json: bool) -> int:
    """Print why a campaign or session cannot run, and return the exit code."""
    if as_json:
        print(json.dumps({"status": "bad input"} | json.loads(report.to_json())))
    else:
        print(report.text())
    return BAD_INPUT


def warn_of_expired(
    campaign: AnyCampaign, *, quiet: bool, swept: Iterable[Iterable[AnyCampaign]] = ()
) -> list[dict[str, Any]]:
    """Warn on standard error of calibrations that are not valid today (UTC), unless ``quiet``.

    Returns the problems as JSON values. ``swept`` holds, for each parameter of a sweep, the
    campaign with each of the parameter's values.
    """
    expired = expired_calibrations(campaign, swept, datetime.now(UTC).date())
    if not quiet:
        for problem in expired:
            print(f"warning: {problem.text()}", file=sys.stderr)
    return [problem.as_dict() for problem in expired]


def expired_calibrations(
    campaign: AnyCampaign, swept: Iterable[Iterable[AnyCampaign]], day: date
) -> tuple[Problem, ...]:
    """Return the expired calibrations of a campaign, or of any case of a sweep.

    A problem of the campaign file's own values counts only if every parameter keeps it for at
    least one value: each case takes one value of each parameter, so a parameter whose values all
    avoid the problem removes it from every case.
    """
    warnings = campaign.kind.validity_warnings
    own = warnings(campaign, day)
    problems_by_parameter = [
        {problem: None for variant in campaigns for problem in warnings(variant, day)}
        for campaigns in swept
    ]
    remaining = [
        problem for problem in own if all(problem in problems for problems in problems_by_parameter)
    ]
    added = [
        problem for problems in problems_by_parameter for problem in problems if problem not in own
    ]
    return tuple(dict.fromkeys((*remaining, *added)))
