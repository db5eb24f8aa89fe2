"""The WaveBot's compiled tick with its plant: the room that sweeps use (`rig.sweep.simulator`).

The modules of this package import numba, and the twin xarray: each takes a second. The functions
here import them when they need them.
"""

from typing import TYPE_CHECKING, Any

from rig.config.yaml_source import KeyPath
from rig.kinds.wavebot import row_contents as contents
from rig.kinds.wavebot.campaign import Campaign, InputFile, Plan
from rig.kinds.wavebot.rehearsal import job
from rig.kinds.wavebot.rehearsal.job import problems, requested_sea
from rig.laws import Law
from rig.planning.input_files import hash_input_file
from rig.row_contents import RowContents

if TYPE_CHECKING:
    from pathlib import Path

    from rig.kinds.wavebot.simulation.hull_in_waves import HullInWaves
    from rig.kinds.wavebot.simulation.simulation import CampaignSimulator

__all__ = [
    "MATCHING_KEYS",
    "identified_range",
    "is_compiled",
    "open_simulator",
    "plant_data",
    "problems",
    "requested_sea",
    "row_contents",
    "wave_device",
]

MATCHING_KEYS: dict[KeyPath, KeyPath] = {
    ("heave", name): path for name, path in job.MATCHING_KEYS.items()
}


def row_contents(campaign: Campaign) -> RowContents:
    """Return the contents of the row table of a campaign."""
    return contents.row_contents(campaign.law.columns)


def plant_data(campaign: Campaign) -> tuple[InputFile, ...]:
    """Return the BEM files of a campaign's plant; that of surge is in the folder of the other."""
    bem = _bem(campaign)
    surge = bem.with_name(campaign.plant["surge"]["bem"])
    return (hash_input_file("bem", bem), hash_input_file("surge.bem", surge))


def open_simulator(
    campaign: Campaign, plan: Plan, sea: dict[str, Any] | None = None
) -> "CampaignSimulator":
    """Return the simulator of a campaign; ``sea`` replaces that of the campaign."""
    from rig.kinds.wavebot.simulation.simulation import CampaignSimulator  # noqa: PLC0415

    return CampaignSimulator(campaign, plan, sea)


def is_compiled(law: Law) -> bool:
    """Return whether this host has already compiled the loop with a law."""
    from rig.kinds.wavebot.simulation import compiled  # noqa: PLC0415
    from rig.kinds.wavebot.simulation.simulation import KEPT_FIELDS  # noqa: PLC0415

    return compiled.is_compiled(KEPT_FIELDS, law)


def wave_device(campaign: Campaign) -> "HullInWaves":
    """Return the bare hull in heave with its wave excitation."""
    from rig.kinds.wavebot.simulation.hull_in_waves import HullInWaves  # noqa: PLC0415

    return HullInWaves(campaign, _bem(campaign))


def identified_range(campaign: Campaign) -> dict[str, tuple[float, float]]:
    """Return the range of amplitudes in which a campaign's twin was identified.

    It is empty for other plant files. Raises ValueError for a damaged file.
    """
    from rig.kinds.wavebot.twin.plant_file import amplitude_range  # noqa: PLC0415

    return amplitude_range(_bem(campaign))


def _bem(campaign: Campaign) -> "Path":
    return campaign.plant_locate.resolve_path(("bem",), campaign.plant["bem"])
