"""Plant files, BEM, reference data and worlds for the tests of sim_plant."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from sim_plant.bem import Bem, read_bem
from sim_plant.parameters import Plant
from sim_plant.prescribed import MotionProfile
from sim_plant.sea_states import Sea, calm
from sim_plant.world import Actuation, Stepper, World

DT = 0.001
ROOT = Path(__file__).resolve().parents[2]
PLANTS = ROOT / "configs" / "plants"
CAPYTAINE = Path(__file__).resolve().parent / "capytaine_heave.npz"  # by compute_bem.py


def merged(base: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    """Merge one mapping into another; an entry (a mapping with a value) is replaced completely."""
    out = dict(base)
    for key, value in over.items():
        below = out.get(key)
        deep = isinstance(value, dict) and isinstance(below, dict) and "value" not in value
        deep = deep and value.get("kind") in (None, below.get("kind"))
        out[key] = merged(below, value) if deep else value
    return out


def mapping(name: str) -> dict[str, Any]:
    """Read a plant file and the files it extends."""
    text: dict[str, Any] = YAML(typ="safe").load(PLANTS / name)
    below = text.pop("extends", None)
    return merged(mapping(below), text) if below else text


@functools.cache
def plant(name: str = "wavebot") -> Plant:
    return Plant.model_validate(mapping(f"{name}.yaml"))


def changed(name: str = "wavebot", **values: Any) -> Plant:
    """Return a plant with some values replaced: changed(spring__spring_effect=0.5)."""
    text = mapping(f"{name}.yaml")
    for path, value in values.items():
        *sections, field = path.split("__")
        inner = text
        for section in sections:
            inner = inner[section]
        inner[field] = {**inner[field], "value": value}
    return Plant.model_validate(text)


@functools.cache
def bem() -> Bem:
    return read_bem(PLANTS / plant().bem)


@functools.cache
def surge_bem() -> Bem:
    return read_bem(PLANTS / plant().surge.bem)


QUIET = {
    "sensors__current_noise": 0.0,
    "sensors__current_resolution": 0.0,
    "sensors__string_pot_bias": 0.0,
    "sensors__string_pot_noise": 0.0,
    "sensors__string_pot_resolution": 0.0,
    "sensors__lcb_bias": 0.0,
    "sensors__lcb_noise": 0.0,
    "sensors__trs_bias": 0.0,
    "sensors__trs_noise": 0.0,
    "sensors__force_resolution": 0.0,
    "sensors__rotor_noise": 0.0,
    "sensors__slew_bias": 0.0,
    "sensors__slew_noise": 0.0,
    "sensors__stator_a_bias": 0.0,
    "sensors__stator_b_bias": 0.0,
    "sensors__stator_noise": 0.0,
    "sensors__probe_noise": 0.0,
    "sensors__probe_resolution": 0.0,
}


def world(
    sea: Sea | None = None,
    name: str = "wavebot",
    seed: int = 1,
    *,
    dt: float = DT,
    device: bool = True,
    stepper: type[Stepper] = Stepper,
    hoist: MotionProfile | None = None,
    **values: Any,
) -> World:
    """Return a world of a plant file with some values replaced; by default 1 ms and calm water."""
    chosen = changed(name, **values) if values else plant(name)
    return World(
        chosen,
        calm() if sea is None else sea,
        bem(),
        surge_bem(),
        dt=dt,
        seed=seed,
        device=device,
        stepper=stepper,
        hoist=hoist,
    )


def command(current: float = 0.0, **more: float) -> Actuation:
    """Return an actuation; by default with the drive on, stator held and no waves."""
    fields: dict[str, Any] = {
        "heave_current": current,
        "heave_enable": 1,
        "stator_target": 0.0,
        "stator_enable": 0,
        "wave_trigger": 0,
        "surge_current": 0.0,
        "surge_enable": 0,
        "conducting": 1,
    }
    return Actuation(**{**fields, **more})
