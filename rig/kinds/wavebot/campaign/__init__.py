"""The WaveBot's campaigns: the room `campaign`, and `rig.campaign` with the WaveBot's types."""

from functools import partial

from rig import campaign
from rig.kinds.wavebot.campaign.kind import CAMPAIGNS
from rig.kinds.wavebot.campaign.set_points import RowSetting
from rig.kinds.wavebot.config.campaign_file import CampaignFile
from rig.kinds.wavebot.config.limits_file import LimitsFile
from rig.kinds.wavebot.config.rig_file import RigFile
from rig.kinds.wavebot.tick import Setpoints

__all__ = [
    "CAMPAIGNS",
    "Campaign",
    "CampaignRow",
    "Plan",
    "check_campaign",
    "open_campaign",
]

Campaign = campaign.Campaign[CampaignFile, RigFile, LimitsFile]
CampaignRow = campaign.CampaignRow[RowSetting]
Plan = campaign.Plan[RowSetting, Setpoints]

check_campaign = partial(campaign.check_campaign, CAMPAIGNS)
open_campaign = partial(campaign.open_campaign, CAMPAIGNS)
