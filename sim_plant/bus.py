"""The custom drive's DC bus: capacitor, supply, dump resistors, voltage trips. Pure.

The stored energy is the state: it changes by exactly what flows in and out. Power into the drive is
positive (consumed), as at every station.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_plant.drive import NO_FAULT, OVERVOLTAGE, UNDERVOLTAGE
from sim_plant.units import Code, Farad, Flag, Joule, Ohm, Second, Siemens, Volt, Watt


class BusParams(NamedTuple):
    """Constants of the bus under the present settings."""

    capacitance: Farad
    set_voltage: Volt
    supply_connected: Flag
    supply_voltage: Volt  # behind a diode: the supply gives, never takes
    supply_resistance: Ohm
    dump_on: Volt
    dump_off: Volt
    dump_conductance: Siemens  # of the resistors that the mask selects
    dump_mask: Code
    undervoltage: Volt  # trips after a delay
    brownout: Volt  # trips at once; below it the drive's logic draws nothing
    overvoltage: Volt  # trips at once
    trip_delay: Second


class BusState(NamedTuple):
    """Stored energy and what has flowed since the start."""

    energy: Joule
    voltage: Volt
    dumping: Flag
    low: Second  # how long the voltage has been below the undervoltage trip
    supplied: Joule
    consumed: Joule  # by the drive; negative when it has delivered
    dumped: Joule


def charged(params: BusParams) -> BusState:
    """Give the state of a bus that stands at its set voltage."""
    voltage = params.set_voltage
    energy = 0.5 * params.capacitance * voltage * voltage
    return BusState(energy, voltage, 0, 0.0, 0.0, 0.0, 0.0)


def trip(params: BusParams, state: BusState) -> Code:
    """Give the fault that the voltage calls for: 0 none, 2 undervoltage, 3 overvoltage."""
    if state.voltage > params.overvoltage:
        return OVERVOLTAGE
    if state.low > params.trip_delay or state.voltage < params.brownout:
        return UNDERVOLTAGE
    return NO_FAULT


def bus_step(params: BusParams, state: BusState, power_dc: Watt, dt: Second) -> BusState:
    """Advance the stored energy by one step of constant power into the drive."""
    energy, voltage, dumping, low, supplied, consumed, dumped = state
    from_supply = 0.0
    gap = params.supply_voltage - voltage
    if params.supply_connected == 1 and gap > 0.0:
        from_supply = voltage * gap / params.supply_resistance * dt
    into_dump = 0.0
    if dumping == 1:
        into_dump = params.dump_conductance * voltage * voltage * dt
    into_drive = power_dc * dt
    energy = energy + (from_supply - into_drive - into_dump)
    if not energy > 0.0:  # out of reach: the drive takes nothing below the brown-out voltage
        energy = 0.0
    voltage = math.sqrt(2.0 * energy / params.capacitance)
    if params.dump_mask == 0 or voltage <= params.dump_off:
        dumping = 0
    elif voltage >= params.dump_on:
        dumping = 1
    low = low + dt if voltage < params.undervoltage else 0.0
    return BusState(
        energy,
        voltage,
        dumping,
        low,
        supplied + from_supply,
        consumed + into_drive,
        dumped + into_dump,
    )
