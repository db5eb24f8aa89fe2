"""The supervisor's side of a wired WaveBot: the settings of its loop and its I/O processes."""

from rig.kinds.wavebot.config.rig_file import RigFile
from rig.kinds.wavebot.config.wiring import WaveBotWiring
from rig.kinds.wavebot.hardware.devices import WaveBotDeviceSettings
from rig.processes import handover
from rig.wires.can_nodes import (
    actuator_settings,
    can_service,
    scaling_settings,
    torque_axis_settings,
)
from rig.wires.job import WiredJob, modbus_pollers, wiring_of

_TRIGGER_PERIOD_S = 0.02  # s between two posts of the outputs
_MAX_LOST_HEARTBEATS = 5  # of a drive; missing process data show a lost drive sooner
_MAX_HEALTH_AGE_S = 0.5  # s


def build_job(rig: RigFile) -> WiredJob:
    """Return the job of a rig file with `wiring`; WiringError lists all reasons against it."""
    wiring = wiring_of(rig)
    service, load = can_service(wiring.can, wiring.drives(), rig.rate_hz)
    devices = {
        "bus": list(wiring.can.settings()),
        "devices": handover.dumps(_device_settings(wiring, 1.0 / rig.rate_hz)),
        "scales": {
            "heave": scaling_settings(wiring.heave, rig.heave.torque_constant_n_m_per_a),
            "surge": scaling_settings(wiring.surge, rig.surge.torque_constant_n_m_per_a),
        },
    }
    return WiredJob((service, *modbus_pollers(wiring)), devices, load)


def _device_settings(wiring: WaveBotWiring, dt: float) -> WaveBotDeviceSettings:
    can = wiring.can
    heartbeat_ms = max(wiring.heave.heartbeat_ms, wiring.surge.heartbeat_ms)
    return WaveBotDeviceSettings(
        own_node=can.own_node,
        heartbeat=can.heartbeat_s,
        health_age=_MAX_HEALTH_AGE_S,
        heartbeat_lost=_MAX_LOST_HEARTBEATS * 1e-3 * heartbeat_ms,
        actuator_divider=can.actuator_divider,
        trigger_divider=max(1, round(_TRIGGER_PERIOD_S / dt)),
        heave=torque_axis_settings(wiring.heave, can, dt),
        surge=torque_axis_settings(wiring.surge, can, dt),
        stator=actuator_settings(wiring.stator, can, dt),
    )
