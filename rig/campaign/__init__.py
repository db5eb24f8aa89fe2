"""Campaigns of any kind of rig: the file becomes the table of segments that the loop executes.

The supervisor alone runs this package; the loop receives the finished `Plan`. What depends on the
kind of rig is its `CampaignKind` (`kind`).
"""

from rig.campaign.check import CheckReport, check_campaign
from rig.campaign.files import CampaignParts, open_campaign
from rig.campaign.kind import (
    AnyCampaign,
    AnyPlan,
    Campaign,
    CampaignKind,
    CampaignRow,
    PhaseSeconds,
    Plan,
    Wait,
)
from rig.campaign.plan import all_rows, build_plan, measured_before
from rig.campaign.record import resolved_config

__all__ = [
    "AnyCampaign",
    "AnyPlan",
    "Campaign",
    "CampaignKind",
    "CampaignParts",
    "CampaignRow",
    "CheckReport",
    "PhaseSeconds",
    "Plan",
    "Wait",
    "all_rows",
    "build_plan",
    "check_campaign",
    "measured_before",
    "open_campaign",
    "resolved_config",
]
