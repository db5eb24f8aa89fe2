"""Emulated devices of a rig without a campaign: calm water, or a bench at rest."""

from pathlib import Path
from typing import Any, NamedTuple

from rig.config.any_rig_file import AnyRigFile, load_rig
from rig.config.bench_rig_file import BenchRigFile
from rig.config.pydantic_errors import validate
from rig.config.yaml_source import load_mapping
from rig.execution.rehearsal.bench_emulation import emulated_bench
from rig.execution.rehearsal.emulation import emulated
from rig.processes.io_processes import IoProcess
from sim_plant.bench.parameters import BenchPlant
from sim_plant.parameters import Plant


class Alone(NamedTuple):
    """A rig and what plays its devices."""

    rig: AnyRigFile
    io_process: IoProcess


def alone(path: Path) -> Alone:
    """The emulated devices of a rig file; ConfigError with every problem of it and its plant.

    The WaveBot's are in calm water; the bench's servo is set up for velocity, its shaft is free.
    """
    rig, locate = load_rig(path)
    plant, there = load_mapping(
        locate.resolve_path(("plant",), rig.plant), locate(("plant",)), "plant"
    )
    if isinstance(rig, BenchRigFile):
        validate(plant, there, BenchPlant)
        return Alone(rig, emulated_bench(rig, plant, 0, "velocity", 0))
    validate(plant, there, Plant)
    devices: dict[str, Any] = {
        "plant": plant,
        "bem": str(there.resolve_path(("bem",), plant["bem"])),
        "sea": {"kind": "calm"},
        "seed": 0,
        "device": "present",
    }
    return Alone(rig, emulated(rig, devices))
