"""What the supervisor hands to the loop process for the devices of a wired WaveBot."""

from typing import NamedTuple

from drivers.canopen.position_actuator import Settings as ActuatorSettings
from drivers.canopen.torque_axis import Settings as AxisSettings


class Config(NamedTuple):
    """Constants of the devices; the drives' scales are still to come from the drives."""

    own_node: int
    heartbeat: float  # s between ours
    health_age: float  # s, age from which the service beside the loop counts as lost
    heartbeat_lost: float  # s without a node's heartbeat
    actuator_divider: int
    trigger_every: int  # ticks between two posts of the outputs
    heave: AxisSettings
    surge: AxisSettings
    stator: ActuatorSettings
