"""The complete resolved configuration of a campaign, as it is stored in each run."""

import json
from typing import Any

from rig.campaign.files import Campaign
from rig.config.problems import shown


def resolved(campaign: Campaign) -> str:
    """JSON text: every key of every file with its default filled in, points, files and sha256.

    Equal campaigns give equal text.
    """
    whole: dict[str, Any] = {
        "campaign": campaign.file.model_dump(mode="json", by_alias=True),
        "points": [
            {"spring_n_per_m": p.spring_rate, "kp_n_s_per_m": p.kp, "ki_n_per_m": p.ki}
            for p in campaign.points
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
