"""Heave imposed by a hoist: a motion over time that starts smoothly from the body's motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np

from sim_plant.units import Metre, MetrePerSecond, Second

MotionProfile = Callable[[Second], tuple[Metre, MetrePerSecond]]
"""Position (m) and velocity (m/s) at a time (s) since the start of the imposed motion."""


def table_profile(times: Sequence[Second], positions: Sequence[Metre]) -> MotionProfile:
    """Return the motion through a table: cubic between points, at rest before and after it.

    Velocity is continuous, and zero where the table reverses (monotone slopes: no overshoot between
    two points). Raises ValueError for fewer than two points, times that do not ascend, or numbers
    that are not finite.
    """
    t, x = np.asarray(times, dtype=np.float64), np.asarray(positions, dtype=np.float64)
    if t.ndim != 1 or t.shape != x.shape or t.size < 2:
        raise ValueError(
            "a motion table needs times and positions of equal length, two points or more; "
            f"got shapes {t.shape} and {x.shape}"
        )
    if not (np.all(np.isfinite(t)) and np.all(np.isfinite(x)) and np.all(np.diff(t) > 0.0)):
        raise ValueError("the numbers of a motion table must be finite and its times must ascend")
    slope = _monotone_slopes(t.tolist(), x.tolist())

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


def hoist_cycle_profile(
    low: Metre, high: Metre, speed: MetrePerSecond, turn: Second
) -> MotionProfile:
    """Return a motion that raises and lowers the body periodically, starting upwards from zero.

    The speed is constant between the ends `low` and `high`; at either end the body reverses in
    `turn` s with constant acceleration, within the travel. Raises ValueError unless low < 0 < high
    and a part of the travel remains at constant speed.
    """
    turn_distance = (
        0.25 * speed * turn
    )  # from the start of the deceleration to the end of the travel
    straight_distance = high - low - 2.0 * turn_distance
    if not (low < 0.0 < high and speed > 0.0 and turn > 0.0 and straight_distance > 0.0):
        raise ValueError(f"no way to raise and lower: {low} .. {high} m, {speed} m/s, {turn} s")
    straight_time = straight_distance / speed  # s at constant speed, in each direction
    half_period = (
        straight_time + turn
    )  # s from the middle of one reversal to the middle of the other
    phase_at_zero = (
        0.5 * turn + (0.0 - low - turn_distance) / speed
    )  # s from the lower reversal to zero

    def profile(time: Second) -> tuple[Metre, MetrePerSecond]:
        phase = (time + phase_at_zero) % (
            2.0 * half_period
        )  # since the middle of the lower reversal
        rising = phase < half_period
        half_phase = phase if rising else phase - half_period
        time_from_turn = min(
            half_phase, half_period - half_phase
        )  # s from the middle of the nearer reversal
        half_turn = 0.5 * turn
        if time_from_turn < half_turn:
            distance, rate_of_change = (
                speed * time_from_turn * time_from_turn / turn,
                2.0 * speed * time_from_turn / turn,
            )
        else:
            distance, rate_of_change = turn_distance + speed * (time_from_turn - half_turn), speed
        distance = distance if half_phase <= 0.5 * half_period else (high - low) - distance
        return (low + distance, rate_of_change) if rising else (high - distance, -rate_of_change)

    return profile


def blend_in(
    profile: MotionProfile, position: Metre, velocity: MetrePerSecond, over: Second
) -> MotionProfile:
    """Return a motion that starts at a position and velocity and equals the profile after `over` s.

    A quintic smooth step blends the two, so position, velocity and acceleration are continuous.
    """

    def blended(time: Second) -> tuple[Metre, MetrePerSecond]:
        x, v = profile(time)
        if not time < over:
            return x, v
        u = max(time, 0.0) / over
        weight = u * u * u * (10.0 + u * (6.0 * u - 15.0))
        weight_rate = 30.0 * u * u * (1.0 - u) * (1.0 - u) / over
        # Without the profile the body would coast to rest with the time constant of the blend.
        decay = math.exp(-time / over)
        coast_position, coast_velocity = (
            position + velocity * over * (1.0 - decay),
            velocity * decay,
        )
        return (
            coast_position + weight * (x - coast_position),
            coast_velocity + weight * (v - coast_velocity) + weight_rate * (x - coast_position),
        )

    return blended


def _monotone_slopes(t: list[float], x: list[float]) -> list[float]:
    """Return the velocity at each point: harmonic mean of both sides, 0 at ends and reversals."""
    rates = [(x1 - x0) / (t1 - t0) for (t0, x0), (t1, x1) in pairwise(zip(t, x, strict=True))]
    inner = [
        2.0 * left * right / (left + right) if left * right > 0.0 else 0.0
        for left, right in pairwise(rates)
    ]
    return [0.0, *inner, 0.0]
