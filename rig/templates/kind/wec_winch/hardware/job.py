"""The job of a wired rig: there is none yet."""

from typing import Any

from rig.config.rig_file import BaseRigFile
from rig.wires.job import WiringError


def build_job(rig: BaseRigFile, *options: Any) -> Any:
    raise WiringError(f"{rig.name} has no wiring: this rig can only be rehearsed")
