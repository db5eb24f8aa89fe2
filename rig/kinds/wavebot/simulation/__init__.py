"""The WaveBot's compiled tick with its plant: the room that sweeps use (`rig.sweeps.simulator`).

The modules of this package import numpy, and the twin xarray. The functions here import them when
they need them.
"""

from collections.abc import Iterator, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from rig.campaign.equilibrium import EquilibriumCheck
from rig.config.problems import Problem
from rig.config.yaml_source import KeyPath
from rig.emulation import campaign_sea
from rig.kinds.wavebot import row_contents as contents
from rig.kinds.wavebot.campaign import Campaign, Plan
from rig.kinds.wavebot.campaign.stability import check_stiffness
from rig.kinds.wavebot.rehearsal import job
from rig.kinds.wavebot.rehearsal.bem_files import bem_paths
from rig.planning.input_files import InputFile, hash_input_file
from rig.row_contents import RowContents

if TYPE_CHECKING:
    from pathlib import Path

    from rig.kinds.wavebot.simulation.hull_in_waves import HullInWaves
    from rig.kinds.wavebot.simulation.simulation import CampaignSimulator

problems = job.problems
requested_sea = campaign_sea.requested_sea


def matching_keys(rig: Mapping[str, Any]) -> dict[KeyPath, KeyPath]:
    """Return the keys of a rig file and those of its plant that must have the same value."""
    return job.MATCHING_KEYS


def row_contents(campaign: Campaign) -> RowContents:
    """Return the contents of the row table of a campaign."""
    return contents.row_contents(campaign.file.heave_law.columns)


def plant_unit(campaign: Campaign, path: KeyPath) -> str:
    """Return an empty text: the plant file has the unit of each number."""
    return ""


def plant_data(campaign: Campaign) -> tuple[InputFile, ...]:
    """Return the BEM files of a campaign's plant."""
    bem, surge = bem_paths(campaign.plant, campaign.plant_locate)
    return (hash_input_file("bem", bem), hash_input_file("surge.bem", surge))


def open_simulator(
    campaign: Campaign, plan: Plan, sea: dict[str, Any] | None = None
) -> "CampaignSimulator":
    """Return the simulator of a campaign; ``sea`` replaces that of the campaign."""
    from rig.kinds.wavebot.simulation.simulation import CampaignSimulator  # noqa: PLC0415

    return CampaignSimulator(campaign, plan, sea)


def equilibrium_check(campaign: Campaign) -> EquilibriumCheck:
    """Return the check whether a set point leaves the body enough stiffness.

    Only the impedance law has a Ki of which this is known.
    """
    if campaign.file.zc_law is None:
        return lambda setting: None
    return partial(check_stiffness, campaign.rig.stability)


def sweep_problems(campaign: Campaign) -> Iterator[Problem]:
    """Yield the reasons why the rows of a valid campaign cannot be simulated."""
    if campaign.file.device == "absent":
        yield campaign.locate.problem(("device",), "absent", "a wave calibration has no rows")
    if campaign.file.hoist is not None:
        yield campaign.locate.problem(("hoist",), None, "compiled code cannot simulate a hoist")


def check_model(run: str, logged: Campaign, model: Campaign) -> None:
    """Raise ValueError if a run had another drive than the model."""
    if logged.rig.drive.kind != model.rig.drive.kind:
        raise ValueError(
            f"{run} was run with a {logged.rig.drive.kind} drive, the model has a "
            f"{model.rig.drive.kind} one; name the campaign of the run as its model"
        )


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
    return bem_paths(campaign.plant, campaign.plant_locate)[0]
