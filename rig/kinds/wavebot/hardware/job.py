"""The supervisor's side of a wired WaveBot: the settings of its loop and its I/O processes."""

from rig.kinds.wavebot.config.rig_file import RigFile
from rig.wires.job import WiredJob, wired_job, wiring_of

_TRIGGER_PERIOD_S = 0.02  # s between two posts of the outputs


def build_job(rig: RigFile) -> WiredJob:
    """Return the job of a rig file with `wiring`; WiringError lists all reasons against it."""
    torque_constants = {
        "heave": rig.heave.torque_constant_n_m_per_a,
        "surge": rig.surge.torque_constant_n_m_per_a,
    }
    devices = {"trigger_divider": max(1, round(_TRIGGER_PERIOD_S * rig.rate_hz))}
    return wired_job(wiring_of(rig), rig.rate_hz, devices, torque_constants)
