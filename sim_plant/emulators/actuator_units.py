"""Conversions between motor turns, the units of the actuator's objects, and stator position."""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.emulators.cia402_drive import Cia402Params
from sim_plant.emulators.device_objects import Objects
from sim_plant.units import Metre, Percent, Volt

TURNS_PER_MINUTE = 0x00B44700  # 60A9


class ActuatorParams(NamedTuple):
    """Mechanics of the actuator, and properties that differ between manufacturers."""

    drive: Cia402Params = Cia402Params(min_voltage=10.0, max_voltage=51.5)  # supply, V
    metre_per_percent: Metre = 0.0015  # of the stator: 0.15 m per 100 %
    screw_lead: Metre = 0.005  # per turn of the actuator's shaft [NC]
    gear_ratio: float = 25.0  # motor turns per shaft turn
    encoder_increments: float = 2000.0  # of the encoder per motor turn
    min_position: Percent = -93.0  # position of the end stops and of the limit switches
    max_position: Percent = 67.0
    switch_margin: Percent = 0.1  # distance from an end stop to where its switch opens
    supply: Volt = 48.0
    home_sign: int = 1  # after homing the position is home_sign times 607C [NC]


class ActuatorUnits:
    """Conversions by the true mechanics and by the present values of 608F, 6091 and 6092."""

    def __init__(self, actuator: ActuatorParams, objects: Objects) -> None:
        self._params = actuator
        self._get = objects.get

    def user_units_per_increment(self) -> float:
        """Return user units per increment: 608F:2/608F:1 6091:2/6091:1 6092:1/6092:2 [C]."""
        get = self._get
        denominator = get(0x608F, 1) * get(0x6091, 1) * get(0x6092, 2)
        numerator = get(0x608F, 2) * get(0x6091, 2) * get(0x6092, 1)
        return numerator / denominator if denominator and numerator else 1.0

    def increments(self, percent: Percent) -> float:
        """Return the increments of the true encoder at a stator position."""
        params = self._params
        return (
            percent
            * params.metre_per_percent
            / params.screw_lead
            * params.gear_ratio
            * params.encoder_increments
        )

    def percent(self, position: float, origin: float) -> Percent:
        """Return the stator position at a position in user units; `origin` (increments) is 0."""
        params = self._params
        turns = (
            (position / self.user_units_per_increment() + origin)
            / params.encoder_increments
            / params.gear_ratio
        )
        return turns * params.screw_lead / params.metre_per_percent

    def speed(self, index: int, sub: int = 0) -> float:
        """Return a speed or acceleration in user units per second (squared).

        60A9 selects turns of the shaft per minute; any other value means user units per second
        [NC].
        """
        value = float(self._get(index, sub))
        if self._get(0x60A9) != TURNS_PER_MINUTE:
            return value
        return value / 60.0 * self._get(0x6092, 1) / max(1, self._get(0x6092, 2))
