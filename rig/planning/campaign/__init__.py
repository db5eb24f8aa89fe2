"""Campaigns: the campaign file becomes the table of segments that the loop executes.

The supervisor alone runs this package; the loop receives the finished `Plan`.
"""

from rig.planning.campaign.check import CheckReport, check_campaign
from rig.planning.campaign.elevation import Elevation, read_elevation
from rig.planning.campaign.files import Campaign, open_campaign
from rig.planning.campaign.input_files import InputFile
from rig.planning.campaign.pieces import CampaignParts
from rig.planning.campaign.plan import CampaignRow, PhaseSeconds, Plan, build_plan
from rig.planning.campaign.point import Point
from rig.planning.campaign.resolved import resolved_config
from rig.planning.campaign.windows import RowWindows, WindowError, row_windows

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
