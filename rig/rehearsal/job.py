"""The supervisor's side of a rehearsal: is the plant in order, what does the loop need of it."""

from typing import Any

from pydantic import ValidationError

from rig.campaign.files import Campaign
from rig.config.problems import Problem
from rig.config.sea import CalmSea, JonswapSea, RegularSea
from rig.config.translate import problems_from
from rig.rehearsal.devices import build_sea
from sim_plant import waves
from sim_plant.bem import read_bem
from sim_plant.parameters import Plant


def devices_of(campaign: Campaign) -> dict[str, Any]:
    """What `connect` needs to stand in for the hardware of a campaign, as JSON values."""
    return {
        "plant": campaign.plant,
        "bem": str(campaign.plant_locate.file(("bem",), campaign.plant["bem"])),
        "sea": _sea_of(campaign),
        "seed": campaign.file.seed,
    }


def problems(campaign: Campaign) -> tuple[Problem, ...]:
    """What the simulated plant objects to in a campaign: its parameters, its BEM file, its sea."""
    locate = campaign.plant_locate
    try:
        plant = Plant.model_validate(campaign.plant)
    except ValidationError as error:
        return tuple(problems_from(error, locate, Plant))
    bem_file = locate.file(("bem",), plant.bem)
    try:
        bem = read_bem(bem_file)
    except (OSError, ValueError, KeyError) as error:
        return (locate.problem(("bem",), plant.bem, f"cannot be read: {error}"),)
    try:
        waves.tables(build_sea(_sea_of(campaign)), bem, 1.0 / campaign.rig.rate_hz)
    except ValueError as error:
        return (campaign.locate.problem(("sea",), campaign.file.sea.words(), str(error)),)
    return ()


def _sea_of(campaign: Campaign) -> dict[str, Any]:
    sea = campaign.file.sea
    if isinstance(sea, CalmSea):
        return {"kind": "calm"}
    if isinstance(sea, RegularSea):
        return {
            "kind": "regular",
            "amplitude_m": sea.amplitude_m,
            "frequency_hz": sea.frequency,
        }
    if isinstance(sea, JonswapSea):
        return {
            "kind": "jonswap",
            "hs_m": sea.hs_m,
            "tp_s": sea.tp_s,
            "gamma": sea.gamma,
            "repeat_s": sea.repeat_s,
            "seed": campaign.file.sea_seed,
        }
    assert campaign.elevation is not None
    return {
        "kind": "recorded",
        "elevation_m": campaign.elevation.elevation.tolist(),
        "rate_hz": campaign.elevation.rate_hz,
    }
