"""Emulated devices of a modular rig: it has no wires yet on which they could be."""

from pathlib import Path
from typing import Any, NoReturn

from rig.config.yaml_source import SourceMap
from rig.kinds.modular.config import RigFile
from rig.kinds.modular.hardware.job import build_job
from rig.wires.job import WiringError


def emulate_rig(rig: RigFile, plant: dict[str, Any], locate_plant: SourceMap) -> NoReturn:
    """Raise WiringError: a modular rig has no wires yet."""
    build_job(rig)


def emulate_task(path: Path, rig: Path) -> NoReturn:
    """Raise WiringError: a modular rig has no wires yet."""
    raise WiringError(f"{rig} has no wiring: a modular rig can only be rehearsed")
