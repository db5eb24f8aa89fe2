"""Campaigns: from the file a person writes to the table the loop walks.

Runs in the supervisor only; the loop gets the finished `Plan`.
"""

from rig.planning.campaign.check import Report, check
from rig.planning.campaign.elevation import Elevation, read_elevation
from rig.planning.campaign.files import Campaign, open_campaign
from rig.planning.campaign.input_files import ReadFile
from rig.planning.campaign.pieces import Pieces
from rig.planning.campaign.plan import CampaignRow, PhaseSeconds, Plan, plan
from rig.planning.campaign.point import Point
from rig.planning.campaign.resolved import resolved
from rig.planning.campaign.windows import WindowError, Windows, windows

__all__ = [
    "Campaign",
    "CampaignRow",
    "Elevation",
    "PhaseSeconds",
    "Pieces",
    "Plan",
    "Point",
    "ReadFile",
    "Report",
    "WindowError",
    "Windows",
    "check",
    "open_campaign",
    "plan",
    "read_elevation",
    "resolved",
    "windows",
]
