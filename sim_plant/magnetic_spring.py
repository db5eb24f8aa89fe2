"""Magnetic spring: torque over rotor angle, rate over stator position, stator actuator. Pure.

Spring rate is positive when it restores: F = -K x on the body.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sim_plant.units import (
    Flag,
    Metre,
    Newton,
    NewtonPerMetre,
    NewtonPerMetrePercent,
    Percent,
    PercentPerSecond,
    Radian,
    RadianPerMetre,
    Ratio,
    Second,
)

# Beyond this angle the run has diverged; the sine of an infinite angle raises an error.
ANGLE_LIMIT = 1.0e6


class SpringParams(NamedTuple):
    """Table of rate over stator position and the shape of the torque law."""

    angle_per_metre: RadianPerMetre  # rotor angle per heave, 1/0.33047
    force_per_rate: Metre  # force amplitude per table rate: lever / (fit slope of sin 2 theta)
    sine: Flag  # 1: T = Tp sin 2 theta; 0: F = -K x
    effect: float  # factor on the table rate
    stator_positions: tuple[float, ...]  # %, ascending
    rates: tuple[float, ...]  # N/m at the stations
    speed: PercentPerSecond


class Table(NamedTuple):
    """Place of a table of rates: positions ascend from entry first to last, rates are shifted."""

    first: int
    shift: int  # the rate of position i is entry i + shift
    last: int


class StatorState(NamedTuple):
    """Stator position, acting rate and slope there, and whether the target is reached."""

    position: Percent
    rate: NewtonPerMetre  # table rate times effect
    slope: NewtonPerMetrePercent  # of the acting rate over stator position
    arrived: Flag


def fit_slope(half_angle: Radian) -> Ratio:
    """Return the least-squares slope of sin 2 theta over ±half_angle: 1.649 at 39.27 deg."""
    numerator = 0.5 * math.sin(2.0 * half_angle) - half_angle * math.cos(2.0 * half_angle)
    return 1.5 * numerator / (half_angle * half_angle * half_angle)


def rate_at(
    positions: Sequence[float], rates: Sequence[float], table: Table, stator: float
) -> float:
    """Return the rate at a stator position, linear between positions and constant beyond them."""
    first, shift, last = table
    if not stator > positions[first]:
        return rates[first + shift]
    for i in range(first, last):
        if stator < positions[i + 1]:
            fraction = (stator - positions[i]) / (positions[i + 1] - positions[i])
            rate_difference = rates[i + shift + 1] - rates[i + shift]
            return rates[i + shift] + fraction * rate_difference
    return rates[last + shift]


def slope_at(
    positions: Sequence[float], rates: Sequence[float], table: Table, stator: float
) -> float:
    """Return the derivative of the rate over stator position.

    At a table position the slope is the mean of both sides (a central difference of the table); at
    the ends and beyond them it is the slope of the outermost segment.
    """
    first, shift, last = table
    total = 0.0
    segments = 0.0
    for i in range(first, last):
        low, high = positions[i], positions[i + 1]
        inside = low <= stator <= high
        if inside or (i == first and stator < low) or (i == last - 1 and stator > high):
            total = total + (rates[i + shift + 1] - rates[i + shift]) / (high - low)
            segments = segments + 1.0
    if not segments > 0.0:
        return 0.0
    return total / segments


def table_rate(params: SpringParams, stator: Percent) -> NewtonPerMetre:
    """Return the acting spring rate at a stator position, N/m: `rate_at` times `effect`.

    Source: MASK4 report (Sandia), Table 4-1.
    """
    table = Table(0, 0, len(params.stator_positions) - 1)
    return params.effect * rate_at(params.stator_positions, params.rates, table, stator)


def table_slope(params: SpringParams, stator: Percent) -> NewtonPerMetrePercent:
    """Return the derivative of `table_rate` over stator position, N/m/%: `slope_at`."""
    table = Table(0, 0, len(params.stator_positions) - 1)
    return params.effect * slope_at(params.stator_positions, params.rates, table, stator)


def stator_at_rest(params: SpringParams, stator: Percent) -> StatorState:
    """Return the state of a stator at rest at a position."""
    return StatorState(stator, table_rate(params, stator), table_slope(params, stator), 1)


def rotor_angle(params: SpringParams, position: Metre) -> Radian:
    """Return the rotor angle from its balance point: theta = x / 0.33047 m."""
    return params.angle_per_metre * position


def force(params: SpringParams, rate: NewtonPerMetre, position: Metre) -> Newton:
    """Return the spring force on the body, N: -(Tp/lever) sin 2 theta, or -rate x if linear.

    Tp is such that the least-squares slope over the fit window is the table rate, so the
    small-signal rate is 1.213 times the table rate and the force falls off at large stroke.
    """
    if params.sine == 0:
        return -rate * position
    double_angle = 2.0 * params.angle_per_metre * position
    if not abs(double_angle) < ANGLE_LIMIT:
        return 0.0
    return -rate * params.force_per_rate * math.sin(double_angle)


def stator_step(
    params: SpringParams, state: StatorState, target: Percent, enable: int, dt: Second
) -> StatorState:
    """Move the stator towards its target at constant speed; hold the position when disabled.

    `arrived` becomes 1 once the stator has been exactly at the target for a whole tick. A target
    that is beyond the ends of the table or not finite is never reached.
    """
    position = state.position
    if position == target or not math.isfinite(target):
        arrived = 1 if position == target else 0
        if arrived == state.arrived:
            return state  # at rest: the rate does not change, no table look-up
        return StatorState(position, state.rate, state.slope, arrived)
    if enable == 0:
        return StatorState(position, state.rate, state.slope, 0)
    max_travel = params.speed * dt
    clamped_target = min(
        max(target, params.stator_positions[0]),
        params.stator_positions[len(params.stator_positions) - 1],
    )
    distance = clamped_target - position
    if abs(distance) <= max_travel:
        position = clamped_target
    elif distance > 0.0:
        position = position + max_travel
    else:
        position = position - max_travel
    return StatorState(position, table_rate(params, position), table_slope(params, position), 0)
