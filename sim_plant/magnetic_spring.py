"""The magnetic spring: torque over rotor angle, rate over stator position, stator actuator. Pure.

Spring rate is positive when it restores: F = -K x on the body.
"""

from __future__ import annotations

import math
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
    Second,
)

# Beyond this the run has diverged; sin of a huge or infinite angle means nothing (and raises).
ANGLE_LIMIT = 1.0e6


class SpringParams(NamedTuple):
    """Table of rate over stator position and the shape of the torque law."""

    angle_per_metre: RadianPerMetre  # rotor angle per heave, 1/0.33047
    reach: Metre  # force amplitude per table rate: lever / (fit slope of sin 2 theta)
    sine: Flag  # 1: T = Tp sin 2 theta; 0: F = -K x
    effect: float  # share of the table rate that acts
    stations: tuple[float, ...]  # %, ascending
    rates: tuple[float, ...]  # N/m at the stations
    speed: PercentPerSecond


class StatorState(NamedTuple):
    """Where the stator is, what rate acts there, how it changes, and whether it has arrived."""

    position: Percent
    rate: NewtonPerMetre  # table rate times effect
    slope: NewtonPerMetrePercent  # of the acting rate over stator position
    arrived: Flag


def table_rate(params: SpringParams, stator: Percent) -> NewtonPerMetre:
    """Give the acting spring rate at a stator position, N/m; ends are held beyond the table.

    Source: MASK4 report (Sandia), Table 4-1, linear between stations, times `effect`.
    """
    last = len(params.stations) - 1
    if not stator > params.stations[0]:
        return params.effect * params.rates[0]
    for i in range(last):
        if stator < params.stations[i + 1]:
            share = (stator - params.stations[i]) / (params.stations[i + 1] - params.stations[i])
            rise = params.rates[i + 1] - params.rates[i]
            return params.effect * (params.rates[i] + share * rise)
    return params.effect * params.rates[last]


def table_slope(params: SpringParams, stator: Percent) -> NewtonPerMetrePercent:
    """Give how the acting rate changes with stator position, N/m/%: the derivative of table_rate.

    At a station it is the mean of both sides (a central difference of the table); at the ends, and
    beyond them, that of the outermost stretch.
    """
    last = len(params.stations) - 1
    total = 0.0
    sides = 0.0
    for i in range(last):
        low, high = params.stations[i], params.stations[i + 1]
        inside = low <= stator <= high
        if inside or (i == 0 and stator < low) or (i == last - 1 and stator > high):
            total = total + (params.rates[i + 1] - params.rates[i]) / (high - low)
            sides = sides + 1.0
    if not sides > 0.0:
        return 0.0
    return params.effect * total / sides


def stator_at(params: SpringParams, stator: Percent) -> StatorState:
    """Give the state of a stator that stands at a position."""
    return StatorState(stator, table_rate(params, stator), table_slope(params, stator), 1)


def rotor_angle(params: SpringParams, position: Metre) -> Radian:
    """Give the rotor angle from its balance point: theta = x / 0.33047 m."""
    return params.angle_per_metre * position


def force(params: SpringParams, rate: NewtonPerMetre, position: Metre) -> Newton:
    """Give the spring force on the body, N: -(Tp/lever) sin 2 theta, or -rate x if linear.

    Tp is such that the least-squares slope over the fit window is the table rate, so the
    small-signal rate is 1.213 times it and the force falls off at large stroke.
    """
    if params.sine == 0:
        return -rate * position
    double_angle = 2.0 * params.angle_per_metre * position
    if not abs(double_angle) < ANGLE_LIMIT:
        return 0.0
    return -rate * params.reach * math.sin(double_angle)


def stator_step(
    params: SpringParams, state: StatorState, target: Percent, enable: int, dt: Second
) -> StatorState:
    """Move the stator towards its target at its one speed; hold when disabled.

    `arrived` needs the target reached exactly and a whole tick at rest there. A target beyond the
    ends of the table or not finite is never reached.
    """
    position = state.position
    if position == target or not math.isfinite(target):
        arrived = 1 if position == target else 0
        if arrived == state.arrived:
            return state  # at rest: the rate stands, no table look-up
        return StatorState(position, state.rate, state.slope, arrived)
    if enable == 0:
        return StatorState(position, state.rate, state.slope, 0)
    reach = params.speed * dt
    goal = min(max(target, params.stations[0]), params.stations[len(params.stations) - 1])
    gap = goal - position
    if abs(gap) <= reach:
        position = goal
    elif gap > 0.0:
        position = position + reach
    else:
        position = position - reach
    return StatorState(position, table_rate(params, position), table_slope(params, position), 0)
