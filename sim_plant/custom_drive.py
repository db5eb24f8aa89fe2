"""The custom motor drive: what may be set during a run."""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.units import Ampere, Code, Second, Volt


class DriveSettings(NamedTuple):
    """What an operator sets seldom; MASK4 report (Sandia), Tables 3-2 and 3-3."""

    scheme: Code  # 0 SVPWM, 1 sine-triangle, 2 DPWM, 3 hysteresis
    bus_voltage: Volt  # set point of the DC bus
    switching_period: Second  # of the PWM schemes
    hysteresis_tolerance: Ampere  # of the hysteresis scheme
    discharge_level: Code  # mask of four dump resistors: 1 one of them, 15 all


# Allowed range of each setting, ends included.
LOWEST = DriveSettings(0, 20.0, 2.0e-5, 0.05, 0)
HIGHEST = DriveSettings(3, 180.0, 1.0e-3, 10.0, 15)


def check(settings: DriveSettings) -> None:
    """Raise ValueError naming every setting that is out of range, with the range."""
    limits = zip(DriveSettings._fields, settings, LOWEST, HIGHEST, strict=True)
    wrong = [
        f"{name} {value!r} is out of range; allowed {low:g} to {high:g}"
        for name, value, low, high in limits
        if not low <= value <= high
    ]
    if wrong:
        raise ValueError("; ".join(wrong))
