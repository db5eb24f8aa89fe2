"""Calibrations that do not hold today, for commands that do not check as `rig check` does."""

import sys
from collections.abc import Iterable
from datetime import UTC, date, datetime
from typing import Any

from rig.config.problems import Problem
from rig.planning.campaign import Campaign
from rig.planning.campaign.validity import validity_warnings


def warn(
    campaign: Campaign, *, quiet: bool, swept: Iterable[Iterable[Campaign]] = ()
) -> list[dict[str, Any]]:
    """Say on standard error what does not hold today (UTC), unless ``quiet``; give it for JSON.

    ``swept`` has for each parameter of a sweep the campaign with each of its values.
    """
    late = of_cases(campaign, swept, datetime.now(UTC).date())
    if not quiet:
        for problem in late:
            print(f"warning: {problem.text()}", file=sys.stderr)
    return [problem.as_dict() for problem in late]


def of_cases(
    campaign: Campaign, swept: Iterable[Iterable[Campaign]], day: date
) -> tuple[Problem, ...]:
    """What is out of date in any case of a sweep, or in a campaign alone.

    What the files' own values are to blame for counts only where no parameter puts all of them
    right: then every case has one of that parameter's values.
    """
    own = validity_warnings(campaign, day)
    by_parameter = [
        {problem: None for each in campaigns for problem in validity_warnings(each, day)}
        for campaigns in swept
    ]
    stays = [problem for problem in own if all(problem in told for told in by_parameter)]
    comes = [problem for told in by_parameter for problem in told if problem not in own]
    return tuple(dict.fromkeys((*stays, *comes)))
