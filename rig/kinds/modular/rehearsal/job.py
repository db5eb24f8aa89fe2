"""The supervisor's side of a modular rig's rehearsal: settings and checks of its plant."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from rig.campaign import AnyCampaign
from rig.config.problems import ConfigError, Problem
from rig.config.pydantic_errors import problems_from
from rig.config.rig_file import mismatches
from rig.config.yaml_source import KeyPath, SourceMap
from rig.emulation.campaign_sea import campaign_sea
from rig.kinds.modular.build import campaign_composition
from rig.kinds.modular.config import RigFile
from rig.kinds.modular.tick import Composition
from rig.kinds.modular.tick.composition import ROTATION
from rig.planning.input_files import ConfigSource
from sim_plant import sea_states
from sim_plant.bem import Bem
from sim_plant.modes import building, stored_radiation
from sim_plant.modes.bem import UnknownModesError, mode_bem
from sim_plant.modes.building import PlantModel
from sim_plant.modes.parameters import Plant
from sim_plant.modes.world import World

_DEFAULT_SEED = 0  # no check depends on the noise


def plant_settings(
    plant: ConfigSource, rig: RigFile, composition: Composition, sea: dict[str, Any], seed: int
) -> dict[str, Any]:
    """Return the configuration of `devices.connect`, as JSON values; ``sea``: of `build_sea`."""
    return {
        **world_settings(plant, sea, seed),
        "composition": composition.to_text(),
        "sensors": [[name, each.scale, each.offset] for name, each in rig.sensors.items()],
    }


def campaign_settings(campaign: AnyCampaign) -> dict[str, Any]:
    """Return the configuration of `devices.connect` for a campaign."""
    return plant_settings(
        ConfigSource(campaign.plant, campaign.plant_locate),
        campaign.rig,
        campaign_composition(campaign),
        campaign_sea(campaign),
        campaign.seed,
    )


def world_settings(plant: ConfigSource, sea: dict[str, Any], seed: int) -> dict[str, Any]:
    """Return the configuration of `devices.build_world`, as JSON values."""
    fitted = radiation_path(plant)
    return {
        "plant": plant.mapping,
        "bem": str(bem_path(plant)),
        "radiation": None if fitted is None else str(fitted),
        "sea": sea,
        "seed": seed,
    }


def bem_path(plant: ConfigSource) -> Path:
    """Return the path of the plant's BEM file, which is relative to the plant file."""
    return plant.locate.resolve_path(("bem",), plant.mapping["bem"])


def radiation_path(plant: ConfigSource) -> Path | None:
    """Return the path of the plant's stored radiation, relative to the plant file; None without."""
    name = plant.mapping.get("radiation")
    return None if name is None else plant.locate.resolve_path(("radiation",), name)


def load_model(plant: ConfigSource) -> tuple[PlantModel | None, tuple[Problem, ...]]:
    """Return the plant with its fitted radiation, or None and its problems."""
    try:
        file = Plant.model_validate(plant.mapping)
    except ValidationError as error:
        return None, problems_from(error, plant.locate, Plant)
    key = "bem"
    try:
        path = bem_path(plant)
        if not path.is_dir():  # Nemoh's results are a folder
            path = plant.locate.existing_path(("bem",), file.bem)
        found = building.read_bem(file, path)
        fitted = radiation_path(plant)
        if fitted is None:
            return building.assemble(file, found), ()
        key = "radiation"
        return building.assemble(file, found, stored_radiation.read(fitted, found)), ()
    except ConfigError as error:
        return None, error.problems
    except UnknownModesError as error:
        return None, tuple(_unknown_modes(error, plant, file))
    except (OSError, ValueError, ArithmeticError) as error:
        message = f"cannot be used: {error}"
        return None, (plant.locate.problem((key,), plant.mapping[key], message),)


def _unknown_modes(error: UnknownModesError, plant: ConfigSource, file: Plant) -> Iterator[Problem]:
    """Yield a problem for each mode of a plant whose `dof` its BEM file lacks."""
    for name, mode in file.modes.items():
        if mode.dof in error.modes:
            listed = ", ".join(error.known)
            message = f"{mode.dof!r} is no mode of {file.bem}; it has {listed}"
            yield plant.locate.problem(("modes", name, "dof"), mode.dof, message)


def plant_problems(
    plant: ConfigSource, rig: RigFile | None, rig_locate: SourceMap | None, rate_hz: int
) -> tuple[PlantModel | None, tuple[Problem, ...]]:
    """Return the model and all problems of a plant with a rig; the model is None with problems.

    ``rig`` is None if the rig file has problems of its own.
    """
    model, found = load_model(plant)
    if model is None:
        return None, found
    if rig is not None and rig_locate is not None:
        found += (*_missing_parts(model.plant, rig, rig_locate),)
        keys = {
            own: of_plant
            for name, axis in rig.axes.items()
            if name in model.plant.axes
            for own, of_plant in matching_keys(name, axis.motion)
        }
        found += (*mismatches(rig, rig_locate, model.plant, plant.locate, keys, "plant"),)
    try:
        World(model, sea_states.calm(), dt=1.0 / rate_hz, seed=_DEFAULT_SEED)
    except (ValueError, ArithmeticError) as error:
        found += (plant.locate.problem((), None, f"cannot be simulated: {error}"),)
    return (None if found else model), found


def first_bem(model: PlantModel) -> Bem:
    """Return the coefficients of one mode in water, with which a sea is checked."""
    modes = model.plant.modes.values()
    return mode_bem(model.bem, next(k for k, mode in enumerate(modes) if mode.dof is not None))


def _missing_parts(plant: Plant, rig: RigFile, locate: SourceMap) -> Iterator[Problem]:
    """Yield the axes and sensors of the rig that the plant does not simulate."""
    for section, own, of_plant in (
        ("axes", rig.axes, plant.axes),
        ("sensors", rig.sensors, plant.sensors),
    ):
        listed = ", ".join(of_plant) or "none"
        for name in own:
            if name not in of_plant:
                message = f"is not in the simulated plant's {section}; it has {listed}"
                yield locate.problem((section, name), None, message)


def matching_keys(axis: str, motion: str) -> Iterator[tuple[KeyPath, KeyPath]]:
    """Yield an axis' keys in rig and plant of equal values: commands would mean other things."""
    gear = "gear_ratio" if motion == ROTATION else "gear_ratio_rad_per_m"
    for own, of_plant in (
        ("torque_constant_n_m_per_a", "torque_constant_n_m_per_a"),
        (gear, "gear_ratio"),
        ("counts_per_revolution", "counts_per_revolution"),
    ):
        yield ("axes", axis, own), ("axes", axis, of_plant)
