"""The files that cases stand on: every text of a campaign, and the data that a simulation reads."""

from rig.planning.campaign import Campaign
from rig.planning.campaign.input_files import InputFile, hash_input_file

DATA = frozenset({"matrix", "elevation", "reference", "bem", "surge.bem"})
"""Roles of files that are read anew whenever a campaign is opened with other values."""


def inputs(campaign: Campaign) -> tuple[InputFile, ...]:
    """Every file of a campaign with its sha256, the BEM data of its plant among them."""
    bem = campaign.plant_locate.resolve_path(("bem",), campaign.plant["bem"])
    surge = bem.with_name(campaign.plant["surge"]["bem"])
    return (*campaign.files, hash_input_file("bem", bem), hash_input_file("surge.bem", surge))
