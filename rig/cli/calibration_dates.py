"""Warnings about expired calibrations, for commands that do not run the full `rig check`."""

import sys
from collections.abc import Iterable
from datetime import UTC, date, datetime
from typing import Any, Protocol

from rig.config.problems import Problem


class DatedTask(Protocol):
    """A campaign, or a task of a sweep."""

    def validity_warnings(self, day: date) -> tuple[Problem, ...]:
        """Return warnings about calibrations that are not valid on a day (UTC)."""


def warn_of_expired(
    task: DatedTask, *, quiet: bool, swept: Iterable[Iterable[DatedTask]] = ()
) -> list[dict[str, Any]]:
    """Warn on standard error of calibrations that are not valid today (UTC), unless ``quiet``.

    Returns the problems as JSON values. ``swept`` holds, for each parameter of a sweep, the
    campaign with each of the parameter's values.
    """
    expired = expired_calibrations(task, swept, datetime.now(UTC).date())
    if not quiet:
        for problem in expired:
            print(f"warning: {problem.text()}", file=sys.stderr)
    return [problem.as_dict() for problem in expired]


def expired_calibrations(
    task: DatedTask, swept: Iterable[Iterable[DatedTask]], day: date
) -> tuple[Problem, ...]:
    """Return the expired calibrations of a campaign, or of any case of a sweep.

    A problem of the campaign file's own values counts only if every parameter keeps it for at
    least one value: each case takes one value of each parameter, so a parameter whose values all
    avoid the problem removes it from every case.
    """
    own = task.validity_warnings(day)
    problems_by_parameter = [
        {problem: None for variant in tasks for problem in variant.validity_warnings(day)}
        for tasks in swept
    ]
    remaining = [
        problem for problem in own if all(problem in problems for problems in problems_by_parameter)
    ]
    added = [
        problem for problems in problems_by_parameter for problem in problems if problem not in own
    ]
    return tuple(dict.fromkeys((*remaining, *added)))
