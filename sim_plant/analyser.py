"""The power analyser: means over windows of its own clock. Pure."""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.units import Second, Watt


class AnalyserState(NamedTuple):
    """Running sums of the open window and the last published means."""

    sum_ac: Watt
    sum_dc: Watt
    samples: int
    power_ac: Watt
    power_dc: Watt
    age: Second


def analyser_step(
    window: Second, state: AnalyserState, power_ac: Watt, power_dc: Watt, dt: Second
) -> AnalyserState:
    """Add one step to the window; publish the means when it is full."""
    sum_ac, sum_dc, samples, last_ac, last_dc, age = state
    sum_ac = sum_ac + power_ac
    sum_dc = sum_dc + power_dc
    samples = samples + 1
    if (samples + 0.5) * dt > window:
        return AnalyserState(0.0, 0.0, 0, sum_ac / samples, sum_dc / samples, 0.0)
    return AnalyserState(sum_ac, sum_dc, samples, last_ac, last_dc, age + dt)
