"""The WaveBot's power stations, those of the MASK4 test (report, section 3.1.3).

To add a station, add a row where it stands in the flow of power.
"""

from typing import TYPE_CHECKING, Any, TypeAlias

from rig.realtime import power
from rig.stations import Station

SIGNALS = (  # forces on the body, tared
    "lcb",  # N, column load cell
    "trs",  # N, shaft torque sensor as a linear force
    "slew",  # N, reaction of the magnetic spring at its lever
    "force",  # N, commanded force of heave
    "velocity",  # m/s, heave
    "surge_force",  # N, commanded
    "surge_velocity",  # m/s
    "ac",  # W, power analyser
    "dc",  # W, power analyser
)
"""The signals that a formula may use: the arguments of `step`."""

STATIONS = (
    Station("mechanical_1", "lcb * velocity", "mechanical (column load cell)", "mechanical",
            "mech 1", alias="mechanical", running_mean=True, force="load.lcb", shown=True),
    Station("mechanical_2", "trs * velocity", "mechanical (shaft torque sensor)",
            "mechanical (shaft)", "mech 2", alias="shaft", force="load.trs", shown=True),
    Station("ac", "ac", "electrical AC", "electrical AC", "AC", running_mean=True, shown=True),
    Station("dc", "dc", "electrical DC", "electrical DC", "DC", running_mean=True, shown=True),
)  # fmt: skip

_CODE = power.compile_stations(STATIONS, SIGNALS, __name__)
start, step = _CODE.start, _CODE.step
if TYPE_CHECKING:
    Power: TypeAlias = Any
else:
    Power = _CODE.power_type
