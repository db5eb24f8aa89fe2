"""The custom drive's DC bus through a whole campaign: what is stored, dumped, and still to be had.

The bus remembers: without supply a row starts with what the rows before it left. So the plan is
walked in its order, in steps of some 20 ms: the capacitor is integrated exactly for constant power,
the supply, whose time constant is shorter, by the solution of its own circuit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.design.predictions.grid import Floats, Grid

STEP = 0.02  # s; dump resistors take 0.5 s and more to move the bus
FOLLOWS = 0.1  # s of a stretch in which the supply follows a raised set point: no extreme counts


class Bus(NamedTuple):
    """The bus under one row's settings."""

    capacitance: float  # F
    set_voltage: float  # V
    connected: int  # 1: the supply is on the bus; it gives and never takes
    supply_voltage: float  # V
    supply_resistance: float  # ohm
    dump_on: float  # V
    dump_off: float  # V
    dump_conductance: float  # S, of the resistors in use
    undervoltage: float  # V, below it the drive trips
    overvoltage: float  # V, above it the drive trips


class Stretch(NamedTuple):
    """A stretch of the plan under one setting."""

    bus: Bus
    power: tuple[float, ...]  # W into the drive, repeating, one value a step
    step: float  # s
    seconds: float


class Voltage(NamedTuple):
    """What the bus does in a stretch."""

    mean: float  # V
    lowest: float
    highest: float
    dumped: float  # W, mean into the dump resistors


def stepped(on: Grid, power: Floats) -> tuple[tuple[float, ...], float]:
    """A record of power (W) as means over steps of about `STEP`, and the step (s)."""
    count = max(1, round(on.period / STEP))
    energy = np.concatenate([[0.0], np.cumsum(power)]) * on.step
    edges = np.interp(
        np.linspace(0.0, on.period, count + 1), np.linspace(0.0, on.period, energy.size), energy
    )
    step = on.period / count
    return tuple((np.diff(edges) / step).tolist()), step


def walk(stretches: Sequence[Stretch]) -> list[Voltage]:
    """The voltage in every stretch, one after the other.

    The bus starts at its set voltage. Where it trips the drive the run would end; what follows is
    told as if it had been charged anew.
    """
    out: list[Voltage] = []
    held = None
    for stretch in stretches:
        start = stretch.bus.set_voltage if held is None else held
        found, held = _through(stretch, start)
        out.append(found)
        if found.lowest < stretch.bus.undervoltage or found.highest > stretch.bus.overvoltage:
            held = None
    return out


def _through(stretch: Stretch, voltage: float) -> tuple[Voltage, float]:
    bus, power, step, _ = stretch
    decay = math.exp(-step / (bus.supply_resistance * bus.capacitance))
    per_joule = 2.0 / bus.capacitance
    supply, resistance = bus.supply_voltage, bus.supply_resistance
    dumping = 0.0
    lowest, highest = math.inf, 0.0
    skipped = round(FOLLOWS / step)
    total = dumped = 0.0
    count = max(1, round(stretch.seconds / step))
    square = voltage * voltage
    length = len(power)
    for i in range(count):
        drawn = power[i % length]
        burnt = dumping * bus.dump_conductance * square
        dumped += burnt
        square = max(square - per_joule * step * (drawn + burnt), 0.0)
        free = math.sqrt(square)
        if bus.connected == 1 and free < supply:
            # V (Vs - V) / R = P where the supply carries all that the drive draws.
            inside = supply * supply - 4.0 * resistance * max(drawn, 0.0)
            goal = 0.5 * (supply + math.sqrt(max(inside, 0.0)))
            free = max(free, goal + (min(voltage, supply) - goal) * decay)
            square = free * free
        voltage = free
        if voltage >= bus.dump_on and bus.dump_conductance > 0.0:
            dumping = 1.0
        elif voltage <= bus.dump_off:
            dumping = 0.0
        total += voltage
        if i >= skipped or i == count - 1:
            lowest, highest = min(lowest, voltage), max(highest, voltage)
    return Voltage(total / count, lowest, highest, dumped / count), voltage
