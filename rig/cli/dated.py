"""Calibrations that do not hold today, for commands that do not check as `rig check` does."""

import sys
from datetime import UTC, datetime
from typing import Any

from rig.campaign import Campaign
from rig.campaign.validity import out_of_date


def warn(campaign: Campaign, *, quiet: bool) -> list[dict[str, Any]]:
    """Say on standard error what does not hold today (UTC), unless ``quiet``; give it for JSON."""
    late = out_of_date(campaign, datetime.now(UTC).date())
    if not quiet:
        for problem in late:
            print(f"warning: {problem.text()}", file=sys.stderr)
    return [problem.as_dict() for problem in late]
