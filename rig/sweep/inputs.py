"""Input files of a sweep's cases: every text file of a campaign, and the data of a simulation."""

from rig.planning.campaign import Campaign
from rig.planning.campaign.input_files import InputFile, hash_input_file

DATA_ROLES = frozenset({"matrix", "elevation", "reference", "bem", "surge.bem"})
"""Roles of files that are read again whenever a campaign is opened with other values."""


def campaign_inputs(campaign: Campaign) -> tuple[InputFile, ...]:
    """Return every file of a campaign with its sha256, including the BEM data of its plant."""
    bem = campaign.plant_locate.resolve_path(("bem",), campaign.plant["bem"])
    surge = bem.with_name(campaign.plant["surge"]["bem"])
    return (*campaign.files, hash_input_file("bem", bem), hash_input_file("surge.bem", surge))
