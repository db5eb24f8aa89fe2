"""Emulated devices of a rig without a campaign: calm water, or a bench at rest."""

from pathlib import Path
from typing import Any, NamedTuple

from rig.config.pydantic_errors import validate
from rig.config.rig_file import BaseRigFile
from rig.config.yaml_source import load_mapping
from rig.kinds.oswec_bench.config.rig_file import BenchRigFile
from rig.kinds.oswec_bench.rehearsal.emulation import emulated_bench_process
from rig.kinds.rig_file import load_rig
from rig.kinds.wavebot.config import RigFile
from rig.kinds.wavebot.rehearsal.emulation import emulated_rig_process
from rig.processes.io_processes import IoProcess
from sim_plant.bench.parameters import BenchPlant
from sim_plant.parameters import Plant


class StandaloneRig(NamedTuple):
    """A rig and the I/O process of its emulated devices."""

    rig: BaseRigFile
    io_process: IoProcess


def load_standalone(path: Path) -> StandaloneRig:
    """Return the emulated devices of a rig file; ConfigError has all problems of it and its plant.

    The WaveBot is in calm water; the bench's servo is set up for velocity, its shaft is free.
    """
    rig, locate, _ = load_rig(path)
    plant, locate_plant = load_mapping(
        locate.resolve_path(("plant",), rig.plant), locate(("plant",)), "plant"
    )
    if isinstance(rig, BenchRigFile):
        validate(plant, locate_plant, BenchPlant)
        return StandaloneRig(rig, emulated_bench_process(rig, plant, 0, "velocity", 0))
    validate(plant, locate_plant, Plant)
    devices: dict[str, Any] = {
        "plant": plant,
        "bem": str(locate_plant.resolve_path(("bem",), plant["bem"])),
        "sea": {"kind": "calm"},
        "seed": 0,
        "device": "present",
    }
    assert isinstance(rig, RigFile)
    return StandaloneRig(rig, emulated_rig_process(rig, devices))
