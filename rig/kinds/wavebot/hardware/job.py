"""The supervisor's side of a wired WaveBot: the settings of its loop and its I/O processes."""

from rig.kinds.wavebot.config.rig_file import RigFile
from rig.wires.can_nodes import can_axes, can_service
from rig.wires.job import WiredJob, modbus_pollers, wiring_of

_TRIGGER_PERIOD_S = 0.02  # s between two posts of the outputs


def build_job(rig: RigFile) -> WiredJob:
    """Return the job of a rig file with `wiring`; WiringError lists all reasons against it."""
    wiring, rate = wiring_of(rig), rig.rate_hz
    service, load = can_service(wiring.can, wiring.drives(), rate)
    torque_constants = {
        "heave": rig.heave.torque_constant_n_m_per_a,
        "surge": rig.surge.torque_constant_n_m_per_a,
    }
    devices = {
        "can": can_axes(wiring.can, wiring.drives(), rate, torque_constants),
        "trigger_divider": max(1, round(_TRIGGER_PERIOD_S * rate)),
    }
    return WiredJob((service, *modbus_pollers(wiring)), devices, load)
