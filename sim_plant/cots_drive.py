"""The commercial (COTS) drive's losses and its stiff bus. Pure.

Power absorbed from the waves is negative at every station.
"""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.units import Ampere, Ohm, Volt, Watt, WattPerAmpere, WattPerAmpereSquared


class CotsParams(NamedTuple):
    """Loss and supply constants."""

    fixed_loss: Watt  # logic and fans: drawn with the power stage on or off
    linear_loss: WattPerAmpere
    square_loss: WattPerAmpereSquared
    bus_voltage: Volt
    bus_resistance: Ohm


def loss(params: CotsParams, current: Ampere) -> Watt:
    """Return the loss between the drive's DC and AC terminals, W: 30 + 3.6 |i| + 0.02 i²."""
    magnitude = abs(current)
    return params.fixed_loss + (params.linear_loss + params.square_loss * magnitude) * magnitude


def bus_voltage(params: CotsParams, power_dc: Watt) -> Volt:
    """Return the DC bus voltage: supply voltage less the drop of its source resistance."""
    return params.bus_voltage - params.bus_resistance * power_dc / params.bus_voltage
