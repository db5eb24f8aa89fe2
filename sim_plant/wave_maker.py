"""The wave maker: elevation and excitation at each tick after its start. Pure.

The sea is a table over one repeat period, read cyclically; its onset is half a cosine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sim_plant.units import Metre, Newton, Ratio, Second


class WaveMakerTables(NamedTuple):
    """One repeat period at the device, one entry per tick, and the onset."""

    elevation: Sequence[float]  # m, undisturbed
    heave: Sequence[float]  # N, excitation force
    surge: Sequence[float]  # N
    onset: Second
    onset_ticks: int  # after which the sea has its full height


class WaveMakerState(NamedTuple):
    """The waves at one tick."""

    tick: int  # since the wave maker was started; -1 while it is off
    table_index: int  # of that tick in the repeat period
    onset_factor: Ratio  # 0 .. 1
    elevation: Metre
    heave: Newton
    surge: Newton


STILL_WATER = WaveMakerState(-1, -1, 1.0, 0.0, 0.0, 0.0)


def step(tables: WaveMakerTables, state: WaveMakerState, dt: Second) -> WaveMakerState:
    """Return the waves one tick later; still water stays still."""
    if state.tick < 0:
        return state
    index = state.table_index + 1  # no remainder: a division is slow
    return _running_state(tables, state.tick + 1, index if index < len(tables.elevation) else 0, dt)


def switch(tables: WaveMakerTables, trigger: int, dt: Second) -> WaveMakerState:
    """Start the waves at t = 0 of the wave clock, or stop them at once."""
    if trigger == 0:
        return STILL_WATER
    return _running_state(tables, 0, 0, dt)


def _running_state(tables: WaveMakerTables, tick: int, index: int, dt: Second) -> WaveMakerState:
    elevations, heaves, surges, onset, onset_ticks = tables
    if tick >= onset_ticks:
        return WaveMakerState(tick, index, 1.0, elevations[index], heaves[index], surges[index])
    factor = onset_ramp(tick * dt, onset)
    return WaveMakerState(
        tick,
        index,
        factor,
        factor * elevations[index],
        factor * heaves[index],
        factor * surges[index],
    )


def value_at(
    table: Sequence[float], first: int, length: int, tick: int, onset: Second, dt: Second
) -> float:
    """Return the value of a sea's table at a tick of the wave clock, within the onset or after it.

    The repeat period has ``length`` entries from index ``first`` on: a table may hold many seas.
    """
    return onset_ramp(tick * dt, onset) * table[first + tick % length]


def onset_ramp(wave_time: Second, duration: Second) -> Ratio:
    """Return the onset factor of the waves, 0..1: half a cosine over `duration`, then exactly 1."""
    if not wave_time < duration:
        return 1.0
    if not wave_time > 0.0:
        return 0.0
    return 0.5 - 0.5 * math.cos(math.pi * wave_time / duration)
