"""Warnings about expired calibrations, for commands that do not run the full `rig check`."""

import sys
from collections.abc import Iterable
from datetime import UTC, date, datetime
from typing import Any

from rig.campaign import AnyCampaign
from rig.config.problems import Problem


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
