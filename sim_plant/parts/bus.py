"""The custom drive's DC bus: capacitor, supply, dump resistors, voltage trips. Pure.

The stored energy is the state: it changes exactly by the energy that flows in and out. Power into
the drive is positive (consumed), as at every station.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_plant.parts.drive import NO_FAULT, OVERVOLTAGE, UNDERVOLTAGE
from sim_plant.units import Code, Farad, Flag, Joule, Ohm, Second, Siemens, Volt, Watt


class BusParams(NamedTuple):
    """Parameters of the bus under the present settings."""

    capacitance: Farad
    set_voltage: Volt
    supply_connected: Flag
    supply_voltage: Volt  # behind a diode: the supply delivers energy and never absorbs it
    supply_resistance: Ohm
    dump_on: Volt
    dump_off: Volt
    dump_conductance: Siemens  # of the resistors that the mask selects
    dump_mask: Code
    undervoltage: Volt  # trips after a delay
    brownout: Volt  # trips at once; below it the drive's logic draws no power
    overvoltage: Volt  # trips at once
    trip_delay: Second


class BusState(NamedTuple):
    """Stored energy, and the energies that have flowed since the start."""

    energy: Joule
    voltage: Volt
    dumping: Flag
    undervoltage_time: Second  # time for which the voltage has been below the undervoltage trip
    supplied: Joule
    consumed: Joule  # by the drive; negative if the drive has fed energy back
    dumped: Joule


def initial(params: BusParams) -> BusState:
    """Return the state of a bus that is charged to its set voltage."""
    voltage = params.set_voltage
    energy = 0.5 * params.capacitance * voltage * voltage
    return BusState(energy, voltage, 0, 0.0, 0.0, 0.0, 0.0)


def voltage_trip(params: BusParams, state: BusState) -> Code:
    """Return the fault code for the voltage: 0 none, 2 undervoltage, 3 overvoltage."""
    if state.voltage > params.overvoltage:
        return OVERVOLTAGE
    if state.undervoltage_time > params.trip_delay or state.voltage < params.brownout:
        return UNDERVOLTAGE
    return NO_FAULT


def bus_step(params: BusParams, state: BusState, power_dc: Watt, dt: Second) -> BusState:
    """Advance the stored energy by one step of constant power into the drive."""
    energy, voltage, dumping, undervoltage_time, supplied, consumed, dumped = state
    supply_energy = 0.0
    voltage_drop = params.supply_voltage - voltage
    if params.supply_connected == 1 and voltage_drop > 0.0:
        supply_energy = voltage * voltage_drop / params.supply_resistance * dt
    dump_energy = 0.0
    if dumping == 1:
        dump_energy = params.dump_conductance * voltage * voltage * dt
    drive_energy = power_dc * dt
    energy = energy + (supply_energy - drive_energy - dump_energy)
    if not energy > 0.0:  # cannot occur: the drive takes no power below the brown-out voltage
        energy = 0.0
    voltage = math.sqrt(2.0 * energy / params.capacitance)
    if params.dump_mask == 0 or voltage <= params.dump_off:
        dumping = 0
    elif voltage >= params.dump_on:
        dumping = 1
    undervoltage_time = undervoltage_time + dt if voltage < params.undervoltage else 0.0
    return BusState(
        energy,
        voltage,
        dumping,
        undervoltage_time,
        supplied + supply_energy,
        consumed + drive_energy,
        dumped + dump_energy,
    )
