"""The custom drive's DC bus through a whole campaign: stored, dumped and available energy.

The bus has memory: without supply a row starts at the voltage that the previous rows left. The
simulation therefore follows the order of the plan, in steps of about 20 ms. It integrates the
capacitor exactly for constant power. The supply has a shorter time constant and follows the
analytical solution of its circuit.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.design.grid import Floats, Grid
from sim_plant.parts.bus import BusParams

STEP = 0.02  # s; the dump resistors need 0.5 s or more to move the bus
# s, initial part of an interval in which the supply follows a raised set point; extremes in it do
# not count.
SUPPLY_RISE_TIME = 0.1


class BusInterval(NamedTuple):
    """An interval of the plan with constant settings."""

    bus: BusParams
    power: tuple[float, ...]  # W into the drive, periodic, one value per step
    step: float  # s
    seconds: float


class BusVoltage(NamedTuple):
    """Bus voltage and dumped power in an interval."""

    mean: float  # V
    lowest: float
    highest: float
    dump_power: float  # W, mean into the dump resistors


def block_means(grid: Grid, power: Floats) -> tuple[tuple[float, ...], float]:
    """Return means of a power record (W) over steps of about `STEP`, and the step (s)."""
    count = max(1, round(grid.period / STEP))
    energy = np.concatenate([[0.0], np.cumsum(power)]) * grid.step
    edges = np.interp(
        np.linspace(0.0, grid.period, count + 1), np.linspace(0.0, grid.period, energy.size), energy
    )
    step = grid.period / count
    return tuple((np.diff(edges) / step).tolist()), step


def simulate(intervals: Sequence[BusInterval]) -> list[BusVoltage]:
    """Return the bus voltage in every interval, in order.

    The bus starts at its set voltage. A trip of the drive would end the run; the intervals after a
    trip start again from the set voltage.
    """
    voltages: list[BusVoltage] = []
    end_voltage = None
    for interval in intervals:
        start = interval.bus.set_voltage if end_voltage is None else end_voltage
        result, end_voltage = _simulate_interval(interval, start)
        voltages.append(result)
        if result.lowest < interval.bus.undervoltage or result.highest > interval.bus.overvoltage:
            end_voltage = None
    return voltages


def _simulate_interval(interval: BusInterval, voltage: float) -> tuple[BusVoltage, float]:
    bus, power, step, _ = interval
    decay = math.exp(-step / (bus.supply_resistance * bus.capacitance))
    per_joule = 2.0 / bus.capacitance
    supply, resistance = bus.supply_voltage, bus.supply_resistance
    dump_active = 0.0
    lowest, highest = math.inf, 0.0
    skipped = round(SUPPLY_RISE_TIME / step)
    total = dump_total = 0.0
    count = max(1, round(interval.seconds / step))
    voltage_squared = voltage * voltage
    length = len(power)
    for i in range(count):
        load_power = power[i % length]
        dump_power = dump_active * bus.dump_conductance * voltage_squared
        dump_total += dump_power
        voltage_squared = max(voltage_squared - per_joule * step * (load_power + dump_power), 0.0)
        new_voltage = math.sqrt(voltage_squared)
        if bus.supply_connected == 1 and new_voltage < supply:
            # V (Vs - V) / R = P where the supply carries the whole load of the drive.
            discriminant = supply * supply - 4.0 * resistance * max(load_power, 0.0)
            equilibrium = 0.5 * (supply + math.sqrt(max(discriminant, 0.0)))
            new_voltage = max(
                new_voltage, equilibrium + (min(voltage, supply) - equilibrium) * decay
            )
            voltage_squared = new_voltage * new_voltage
        voltage = new_voltage
        if voltage >= bus.dump_on and bus.dump_conductance > 0.0:
            dump_active = 1.0
        elif voltage <= bus.dump_off:
            dump_active = 0.0
        total += voltage
        if i >= skipped or i == count - 1:
            lowest, highest = min(lowest, voltage), max(highest, voltage)
    return BusVoltage(total / count, lowest, highest, dump_total / count), voltage
