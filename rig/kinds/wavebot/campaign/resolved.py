"""The resolved configuration of a campaign, which every run stores."""

import json
from pathlib import Path
from typing import Any

from rig.config.problems import display_path
from rig.kinds.wavebot.campaign.files import Campaign
from rig.kinds.wavebot.config.columns import COLUMNS


def resolved_config(campaign: Campaign) -> str:
    """Return JSON text with every key of every file, with defaults, points, and files with sha256.

    Equal campaigns give equal text.
    """
    columns = COLUMNS.with_law(campaign.law.columns)
    config: dict[str, Any] = {
        "campaign": campaign.file.model_dump(mode="json", by_alias=True),
        "points": [
            {c.key: p.values[c.name] for c in columns if c.name in p.values}
            for p in campaign.points
        ],
        "rig": campaign.rig.model_dump(mode="json", by_alias=True),
        "limits": campaign.limits.model_dump(mode="json", by_alias=True),
        "plant": campaign.plant,
        "law": campaign.law.record() | {"path": display_path(Path(campaign.law.path))},
        "files": [file.as_dict() for file in campaign.files],
    }
    return json.dumps(config, ensure_ascii=False, indent=2)
