"""The job of the wired rig: one drive on a CAN bus."""

from rig.config.wiring import wiring_of
from rig.wires.job import WiredJob, wired_job

from wec_winch.config import RigFile


def build_job(rig: RigFile) -> WiredJob:
    return wired_job(wiring_of(rig), rig.rate_hz, {})
