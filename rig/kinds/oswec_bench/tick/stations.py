"""The bench's power stations, from the brake or flap to the motor.

The difference of both is friction of gearbox and bearing (OSWEC thesis (University of Washington),
3.1.2) and what motor and driveline store. Neither the electrical power of the servo drive nor the
torque of the brake itself is measured, so they are no stations.
"""

from typing import TYPE_CHECKING, Any, TypeAlias

from rig.realtime import power
from rig.stations import Station

SIGNALS = (  # at the gearbox output; torques are those of the motor's side on the load
    "cell_torque",  # N*m, load cell, tared
    "shaft_velocity",  # rad/s, behind the coupling
    "motor_torque",  # N*m, torque constant times measured current
    "motor_velocity",  # rad/s
)
"""The signals that a formula may use: the arguments of `step`."""

STATIONS = (
    Station("load_cell", "cell_torque * shaft_velocity", "mechanical (load cell)", "mechanical",
            "cell", alias="cell", running_mean=True, force="load.tz", shown=True),
    Station("motor", "motor_torque * motor_velocity", "mechanical (motor current)", "motor",
            "motor", running_mean=True, shown=True),
)  # fmt: skip

_CODE = power.compile_stations(STATIONS, SIGNALS, __name__)
start, step = _CODE.start, _CODE.step
if TYPE_CHECKING:
    Power: TypeAlias = Any
else:
    Power = _CODE.power_type
