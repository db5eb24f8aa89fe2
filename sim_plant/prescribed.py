"""Heave that a hoist imposes: a motion over time, taken up smoothly from where the body is."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from sim_plant.units import Metre, MetrePerSecond, Second

Profile = Callable[[Second], tuple[Metre, MetrePerSecond]]
"""Position (m) and velocity (m/s) at a time (s) since the hoist took hold."""


def from_table(times: Sequence[Second], positions: Sequence[Metre]) -> Profile:
    """Give the motion through a table: cubic between points, at rest before the first and after it.

    Velocity is continuous, and zero where the table turns (monotone slopes: no overshoot between
    two points). Raises ValueError for fewer than two points, times that do not ascend, or numbers
    that are not finite.
    """
    t, x = np.asarray(times, dtype=np.float64), np.asarray(positions, dtype=np.float64)
    if t.ndim != 1 or t.shape != x.shape or t.size < 2:
        raise ValueError("a motion table is two rows of equal length, two points or more")
    if not (np.all(np.isfinite(t)) and np.all(np.isfinite(x)) and np.all(np.diff(t) > 0.0)):
        raise ValueError("a motion table is finite and its times ascend")
    slope = _slopes(t.tolist(), x.tolist())

    def profile(time: Second) -> tuple[Metre, MetrePerSecond]:
        i = int(np.searchsorted(t, time, side="right")) - 1
        if i < 0:
            return float(x[0]), 0.0
        if i >= t.size - 1:
            return float(x[-1]), 0.0
        span = float(t[i + 1] - t[i])
        u = (time - float(t[i])) / span
        rise, left, right = float(x[i + 1] - x[i]), span * slope[i], span * slope[i + 1]
        a, b = left + right - 2.0 * rise, 3.0 * rise - 2.0 * left - right
        position = float(x[i]) + u * (left + u * (b + u * a))
        return position, (left + u * (2.0 * b + 3.0 * u * a)) / span

    return profile


def raised_and_lowered(low: Metre, high: Metre, speed: MetrePerSecond, turn: Second) -> Profile:
    """Give a body raised and lowered for ever: constant speed between two ends, from zero upwards.

    At either end it turns round in `turn` s with constant acceleration, within the travel.
    Raises ValueError unless low < 0 < high and there is a way at constant speed.
    """
    bend = 0.25 * speed * turn  # from where it begins to slow down to the end
    reach = high - low - 2.0 * bend
    if not (low < 0.0 < high and speed > 0.0 and turn > 0.0 and reach > 0.0):
        raise ValueError(f"no way to raise and lower: {low} .. {high} m, {speed} m/s, {turn} s")
    way = reach / speed  # s at constant speed, either way
    half = way + turn  # s from the middle of one turn to that of the other
    bottom = 0.5 * turn + (0.0 - low - bend) / speed  # from there it takes so long to zero

    def profile(time: Second) -> tuple[Metre, MetrePerSecond]:
        since = (time + bottom) % (2.0 * half)  # of the turn at the lower end
        rising = since < half
        left = since if rising else since - half
        into = min(left, half - left)  # s from the nearer turn's middle
        near = 0.5 * turn
        if into < near:
            gone, rate = speed * into * into / turn, 2.0 * speed * into / turn
        else:
            gone, rate = bend + speed * (into - near), speed
        gone = gone if left <= 0.5 * half else (high - low) - gone
        return (low + gone, rate) if rising else (high - gone, -rate)

    return profile


def taken_up(profile: Profile, position: Metre, velocity: MetrePerSecond, over: Second) -> Profile:
    """Give the motion that leaves a position and velocity and is the profile's after `over` s.

    The two are mixed with a quintic smooth step, so position, velocity and acceleration join.
    """

    def joined(time: Second) -> tuple[Metre, MetrePerSecond]:
        x, v = profile(time)
        if not time < over:
            return x, v
        u = max(time, 0.0) / over
        share = u * u * u * (10.0 + u * (6.0 * u - 15.0))
        growth = 30.0 * u * u * (1.0 - u) * (1.0 - u) / over
        # Left alone the body would coast to rest with the time constant of the take-up.
        fading = math.exp(-time / over)
        old_x, old_v = position + velocity * over * (1.0 - fading), velocity * fading
        return (
            old_x + share * (x - old_x),
            old_v + share * (v - old_v) + growth * (x - old_x),
        )

    return joined


def _slopes(t: list[float], x: list[float]) -> list[float]:
    """Velocity at each point: harmonic mean of both sides, zero at the ends and where it turns."""
    rates = [(x1 - x0) / (t1 - t0) for (t0, x0), (t1, x1) in pairwise(zip(t, x, strict=True))]
    inner = [
        2.0 * left * right / (left + right) if left * right > 0.0 else 0.0
        for left, right in pairwise(rates)
    ]
    return [0.0, *inner, 0.0]
