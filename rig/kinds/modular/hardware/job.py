"""The job of a wired modular rig: its files have no wiring yet, so it can only be rehearsed."""

from typing import NoReturn

from rig.kinds.modular.config import RigFile
from rig.wires.job import WiringError


def build_job(rig: RigFile) -> NoReturn:
    """Raise WiringError: a modular rig has no wires yet."""
    raise WiringError(f"{rig.name} has no wiring: a modular rig can only be rehearsed")
