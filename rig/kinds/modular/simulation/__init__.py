"""A modular rig's compiled tick with its plant: the room that sweeps use (`rig.sweeps.simulator`).

The modules of this package import the readers of BEM files, which takes a second. The functions
here import them when they need them.
"""

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from rig.campaign.equilibrium import EquilibriumCheck
from rig.config.problems import Problem
from rig.config.yaml_source import KeyPath
from rig.emulation import campaign_sea
from rig.kinds.modular import checks
from rig.kinds.modular import row_contents as contents
from rig.kinds.modular.campaign import axis_motions
from rig.kinds.modular.rehearsal import job
from rig.planning.input_files import ConfigSource, InputFile, hash_input_file
from rig.row_contents import RowContents
from sim_plant.modes.bem import bem_files
from sim_plant.modes.parameters import Plant, plain_unit

if TYPE_CHECKING:
    from rig.kinds.modular.simulation.simulation import CampaignSimulator
    from rig.kinds.modular.simulation.waves import BodyInWaves

problems = checks.problems
requested_sea = campaign_sea.requested_sea


def matching_keys(rig: Mapping[str, Any]) -> dict[KeyPath, KeyPath]:
    """Return the keys of an unchecked rig file and of its plant that must have the same value."""
    return {
        own: of_plant
        for name, motion in axis_motions(rig)
        for own, of_plant in job.matching_keys(name, motion)
    }


def row_contents(campaign: Any) -> RowContents:
    """Return the contents of the row table of a campaign."""
    return contents.row_contents(campaign.rig, campaign.file.columns())


def plant_unit(campaign: Any, path: KeyPath) -> str:
    """Return the unit of a plain number of the plant file at a key; empty if it has none."""
    turning = {name for name, axis in campaign.rig.axes.items() if axis.motion == "rotation"}
    unit = plain_unit(Plant.model_validate(campaign.plant), [*map(str, path)], turning)
    return "" if unit == "1" else unit


def plant_data(campaign: Any) -> tuple[InputFile, ...]:
    """Return the files of a campaign's plant: BEM coefficients, and its stored radiation if any."""
    plant = _plant(campaign)
    files = [("bem", file) for file in bem_files(job.bem_path(plant))]
    if (fitted := job.radiation_path(plant)) is not None:
        files.append(("radiation", fitted))
    return tuple(hash_input_file(kind, file) for kind, file in files)


def open_simulator(
    campaign: Any, plan: Any, sea: dict[str, Any] | None = None
) -> "CampaignSimulator":
    """Return the simulator of a campaign; ``sea`` replaces that of the campaign."""
    from rig.kinds.modular.simulation.simulation import CampaignSimulator  # noqa: PLC0415

    return CampaignSimulator(campaign, plan, sea)


def equilibrium_check(campaign: Any) -> EquilibriumCheck:
    """Return the check whether a set point leaves the body an equilibrium."""
    from rig.kinds.modular import equilibrium  # noqa: PLC0415

    return equilibrium.equilibrium_check(campaign)


def sweep_problems(campaign: Any) -> Iterator[Problem]:
    """Yield the reasons why the rows of a valid campaign cannot be simulated."""
    yield from checks.limits_of_other_axes(campaign)


def check_model(run: str, logged: Any, model: Any) -> None:
    """Raise ValueError if a run's rig has an axis or a sensor that the model's plant lacks."""
    for kind in ("axes", "sensors"):
        parts = model.plant.get(kind) or {}
        if missing := [name for name in getattr(logged.rig, kind) if name not in parts]:
            raise ValueError(
                f"{run}: its rig has the {kind} {', '.join(missing)}, which the plant of the model "
                f"lacks; it has {', '.join(parts) or 'none'}: name the campaign of the run as "
                "its model"
            )


def wave_device(campaign: Any) -> "BodyInWaves":
    """Return the body in waves, from whose motion waves are recovered."""
    from rig.kinds.modular.simulation.waves import BodyInWaves  # noqa: PLC0415

    model, found = job.load_model(_plant(campaign))
    if model is None:
        raise ValueError("; ".join(each.message for each in found))
    return BodyInWaves(campaign.rig, model)


def identified_range(campaign: Any) -> dict[str, tuple[float, float]]:
    """Return no range: plants of modular rigs are not identified."""
    return {}


def _plant(campaign: Any) -> ConfigSource:
    return ConfigSource(campaign.plant, campaign.plant_locate)
