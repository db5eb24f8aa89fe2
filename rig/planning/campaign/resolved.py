"""The complete resolved configuration of a campaign, as it is stored in each run."""

import json
from typing import Any

from rig.config.columns import COLUMNS
from rig.config.problems import shown
from rig.planning.campaign.files import Campaign


def resolved(campaign: Campaign) -> str:
    """JSON text: every key of every file with its default filled in, points, files and sha256.

    Equal campaigns give equal text.
    """
    whole: dict[str, Any] = {
        "campaign": campaign.file.model_dump(mode="json", by_alias=True),
        "points": [
            {c.key: p.given[c.name] for c in COLUMNS if c.name in p.given} for p in campaign.points
        ],
        "rig": campaign.rig.model_dump(mode="json", by_alias=True),
        "limits": campaign.limits.model_dump(mode="json", by_alias=True),
        "plant": campaign.plant,
        "files": [
            {"role": file.role, "path": shown(file.path), "sha256": file.sha256}
            for file in campaign.files
        ],
    }
    return json.dumps(whole, ensure_ascii=False, indent=2)
