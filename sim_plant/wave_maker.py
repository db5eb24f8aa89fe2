"""The wave maker's clock: what the sea is at each tick from its start on. Pure.

The sea is a table over one repeat period, walked round and round; it comes on over half a cosine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sim_plant.units import Metre, Newton, Ratio, Second


class Tables(NamedTuple):
    """One repeat period at the device, one entry a tick, and how the sea comes on."""

    elevation: Sequence[float]  # m, undisturbed
    heave: Sequence[float]  # N, excitation force
    surge: Sequence[float]  # N
    onset: Second
    onset_ticks: int  # after which the sea is whole


class Sea(NamedTuple):
    """What the waves are in one tick."""

    tick: int  # since the wave maker was started; -1 while it stands
    place: int  # of that tick in the repeat period
    share: Ratio  # 0 .. 1: how far the sea has come on
    elevation: Metre
    heave: Newton
    surge: Newton


STILL = Sea(-1, -1, 1.0, 0.0, 0.0, 0.0)


def step(tables: Tables, sea: Sea, dt: Second) -> Sea:
    """Give the waves one tick later; still water stays still."""
    if sea.tick < 0:
        return sea
    place = sea.place + 1  # not by a remainder: a division costs
    return _at(tables, sea.tick + 1, place if place < len(tables.elevation) else 0, dt)


def switch(tables: Tables, trigger: int, dt: Second) -> Sea:
    """Start the waves at t = 0 of their clock, or still the water at once."""
    if trigger == 0:
        return STILL
    return _at(tables, 0, 0, dt)


def _at(tables: Tables, tick: int, i: int, dt: Second) -> Sea:
    elevations, heaves, surges, onset, onset_ticks = tables
    if tick >= onset_ticks:
        return Sea(tick, i, 1.0, elevations[i], heaves[i], surges[i])
    share = ramp(tick * dt, onset)
    return Sea(tick, i, share, share * elevations[i], share * heaves[i], share * surges[i])


def ramp(wave_time: Second, duration: Second) -> Ratio:
    """Give the onset factor of the waves, 0..1: half a cosine over `duration`, then exactly 1."""
    if not wave_time < duration:
        return 1.0
    if not wave_time > 0.0:
        return 0.0
    return 0.5 - 0.5 * math.cos(math.pi * wave_time / duration)
