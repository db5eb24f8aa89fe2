"""Campaigns: from the file a person writes to the table the loop walks.

Runs in the supervisor only; the loop gets the finished `Plan`.
"""

from rig.campaign.check import Report, check
from rig.campaign.elevation import Elevation, read_elevation
from rig.campaign.files import Campaign, open_campaign
from rig.campaign.pieces import Pieces
from rig.campaign.plan import CampaignRow, PhaseSeconds, Plan, plan
from rig.campaign.point import Point
from rig.campaign.resolved import resolved
from rig.campaign.sources import ReadFile
from rig.campaign.windows import WindowError, Windows, windows

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
