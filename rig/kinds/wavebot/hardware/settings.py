"""The settings of a wired WaveBot's devices, which the supervisor sends to the loop process."""

from typing import NamedTuple

from drivers.canopen.position_actuator import ActuatorSettings
from drivers.canopen.torque_axis import TorqueAxisSettings as AxisSettings


class WaveBotDeviceSettings(NamedTuple):
    """Constants of the devices; the current scales are read from the drives later."""

    own_node: int
    heartbeat: float  # s between the loop's own heartbeats
    health_age: float  # s, age of the health messages from which the service process counts as lost
    heartbeat_lost: float  # s without a node's heartbeat until it counts as lost
    actuator_divider: int
    trigger_divider: int  # ticks between two posts of the outputs
    heave: AxisSettings
    surge: AxisSettings
    stator: ActuatorSettings
