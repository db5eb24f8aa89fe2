"""Campaigns: the campaign file becomes the table of segments that the loop executes.

The supervisor alone runs this package; the loop receives the finished `Plan`.
"""

from rig.kinds.wavebot.campaign.check import CheckReport, check_campaign
from rig.kinds.wavebot.campaign.files import Campaign, open_campaign
from rig.kinds.wavebot.campaign.pieces import CampaignParts
from rig.kinds.wavebot.campaign.plan import CampaignRow, PhaseSeconds, Plan, build_plan
from rig.kinds.wavebot.campaign.resolved import resolved_config
from rig.planning.elevation import Elevation, read_elevation
from rig.planning.input_files import InputFile
from rig.planning.point import Point
from rig.planning.windows import RowWindows, WindowError, row_windows

__all__ = [
    "Campaign",
    "CampaignParts",
    "CampaignRow",
    "CheckReport",
    "Elevation",
    "InputFile",
    "PhaseSeconds",
    "Plan",
    "Point",
    "RowWindows",
    "WindowError",
    "build_plan",
    "check_campaign",
    "open_campaign",
    "read_elevation",
    "resolved_config",
    "row_windows",
]
