"""From turns of a motor to the units of its objects and to the stator it moves."""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.emulators.cia402_node import DriveParams
from sim_plant.emulators.node_objects import Objects
from sim_plant.units import Metre, Percent, Volt

TURNS_PER_MINUTE = 0x00B44700  # 60A9


class ActuatorParams(NamedTuple):
    """The mechanics, and what differs between makers."""

    drive: DriveParams = DriveParams(lowest=10.0, highest=51.5)  # supply, V
    metre_per_percent: Metre = 0.0015  # of the stator: 0.15 m per 100 %
    lead: Metre = 0.005  # per turn of the actuator's shaft [NC]
    gear: float = 25.0  # motor turns per shaft turn
    increments: float = 2000.0  # of the encoder per motor turn
    low: Percent = -93.0  # blocks, and limit switches that close there
    high: Percent = 67.0
    switch: Percent = 0.1  # from a block to where its switch opens
    supply: Volt = 48.0
    home_sign: int = 1  # after homing the position is home_sign times 607C [NC]


class ActuatorUnits:
    """The true mechanics beside what 608F, 6091 and 6092 say of them now."""

    def __init__(self, actuator: ActuatorParams, objects: Objects) -> None:
        self._own = actuator
        self._get = objects.get

    def unit(self) -> float:
        """Give user units per increment: 608F:2/608F:1 6091:2/6091:1 6092:1/6092:2 [C]."""
        get = self._get
        over = get(0x608F, 1) * get(0x6091, 1) * get(0x6092, 2)
        under = get(0x608F, 2) * get(0x6091, 2) * get(0x6092, 1)
        return under / over if over and under else 1.0

    def increments(self, percent: Percent) -> float:
        """Give the true encoder's increments at a stator position."""
        own = self._own
        return percent * own.metre_per_percent / own.lead * own.gear * own.increments

    def percent(self, position: float, origin: float) -> Percent:
        """Give the stator position at a position in user units, `origin` (increments) being 0."""
        own = self._own
        turns = (position / self.unit() + origin) / own.increments / own.gear
        return turns * own.lead / own.metre_per_percent

    def speed(self, index: int, sub: int = 0) -> float:
        """Give a speed or acceleration in user units per second (squared).

        60A9 says turns of the shaft per minute, or else user units per second [NC].
        """
        value = float(self._get(index, sub))
        if self._get(0x60A9) != TURNS_PER_MINUTE:
            return value
        return value / 60.0 * self._get(0x6092, 1) / max(1, self._get(0x6092, 2))
