"""Emulated devices of a rig without a campaign: in calm water, with nothing but the rig file."""

from pathlib import Path
from typing import Any, NamedTuple

from rig.companions import Companion
from rig.config import RigFile
from rig.config.source import load_mapping
from rig.config.translate import load, validate
from rig.rehearsal.emulation import emulated
from sim_plant.parameters import Plant


class Alone(NamedTuple):
    """A rig and what plays its devices."""

    rig: RigFile
    companion: Companion


def in_calm_water(path: Path) -> Alone:
    """The emulated devices of a rig file; ConfigError with every problem of it and its plant."""
    rig, locate = load(path, RigFile)
    plant, there = load_mapping(locate.file(("plant",), rig.plant), locate(("plant",)), "plant")
    validate(plant, there, Plant)
    devices: dict[str, Any] = {
        "plant": plant,
        "bem": str(there.file(("bem",), plant["bem"])),
        "sea": {"kind": "calm"},
        "seed": 0,
        "device": "present",
    }
    return Alone(rig, emulated(rig, devices))
