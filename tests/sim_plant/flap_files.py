"""Flap plants and worlds for the tests of the flap."""

from __future__ import annotations

from typing import Any

from plant_files import mapping

from sim_plant import sea_states
from sim_plant.flap.parameters import FlapPlant
from sim_plant.flap.stepper import Stepper
from sim_plant.flap.world import Actuation, FlapWorld
from sim_plant.sea_states import Sea

DT = 0.001

SMOOTH = {
    "flap__viscous_quadratic": 0.0,
    "flap__far_side": None,
    "seal": None,
    "bearing": None,
    "gearbox__dry": 0.0,
    "gearbox__breakaway": 0.0,
    "gearbox__share_forward": 0.0,
    "gearbox__share_back": 0.0,
    "gearbox__spread_forward": 0.0,
    "gearbox__spread_back": 0.0,
    "motor__viscous": 0.0,
}
"""No dry friction and no quadratic drag: the system has a closed form."""


def changed(name: str = "oswec_flap", **values: Any) -> FlapPlant:
    """Return a plant with some values replaced; None sets a section's friction to zero."""
    text = mapping(f"{name}.yaml")
    for path, value in values.items():
        *sections, field = path.split("__")
        inner = text
        for section in sections:
            inner = inner[section]
        if value is None:
            inner[field] = {key: {**entry, "value": 0.0} for key, entry in inner[field].items()}
        else:
            inner[field] = {**inner[field], "value": value}
    return FlapPlant.model_validate(text)


def flap(
    sea: Sea | None = None,
    name: str = "oswec_flap",
    *,
    seed: int = 1,
    stepper: type[Stepper] = Stepper,
    **values: Any,
) -> FlapWorld:
    """Return a flap at 1 kHz in calm water, interpreted by default."""
    plant = changed(name, **values)
    return FlapWorld(plant, sea or sea_states.calm(), dt=DT, seed=seed, stepper=stepper)


def torque(current: float, *, locked: int = 0) -> Actuation:
    """Return an actuation with the motor's torque loop on."""
    return Actuation(1, 1, 0.0, current, 0.0, locked)
