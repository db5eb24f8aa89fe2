"""The supervisor's side of a wired WaveBot: the settings of its loop and its I/O processes."""

from rig.config.wiring import wiring_of
from rig.kinds.wavebot.config.rig_file import RigFile
from rig.wires.job import WiredJob, trigger_divider, wired_job


def build_job(rig: RigFile) -> WiredJob:
    """Return the job of a rig file with `wiring`; WiringError lists all reasons against it."""
    torque_constants = {
        "heave": rig.heave.torque_constant_n_m_per_a,
        "surge": rig.surge.torque_constant_n_m_per_a,
    }
    devices = {"trigger_divider": trigger_divider(rig.rate_hz)}
    return wired_job(wiring_of(rig), rig.rate_hz, devices, torque_constants)
