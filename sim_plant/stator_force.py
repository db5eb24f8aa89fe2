"""Axial force on the magnetic spring's stator, its reversal, and the slew force. Pure.

Torque and axial force come from one energy W(theta, z) = -1/2 Tp(z) cos 2 theta + G(z):
T = dW/dtheta = Tp sin 2 theta (restoring on the rotor), F_stator = dW/dz = F0(z) - 1/2 Tp'(z)
cos 2 theta, the force that holds the stator, along rising stator position. F0 = dG/dz = pull |Tp|
is chosen so that the force reverses at 45 degrees exactly where Tp is zero, later the larger |Tp|
is, and never where pull |Tp| > 1/2 |Tp'| (MASK4 report (Sandia), Fig. 4-3).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_plant.magnetic_spring import ANGLE_LIMIT, SpringParams, table_rate, table_slope
from sim_plant.units import (
    Flag,
    Metre,
    Newton,
    NewtonMetre,
    NewtonPerMetre,
    NewtonPerMetrePercent,
    Percent,
    PerMetre,
    Radian,
    Ratio,
)


class StatorForceParams(NamedTuple):
    """Geometry and shares of the stator force."""

    sine: Flag  # 1: as above; 0: the linear spring's energy, cos 2 theta -> 1 - 2 theta²
    metre_squared: float  # torque amplitude Tp per acting rate, N m per N/m
    percent_per_metre: float  # stator position per axial travel
    pull: PerMetre  # F0 per |Tp|
    slew_lever: Metre
    share_a: Ratio  # of the force on load cell A; B carries the rest


def torque(params: StatorForceParams, rate: NewtonPerMetre, angle: Radian) -> NewtonMetre:
    """Give the spring torque that restores the rotor, N m: T = Tp sin 2 theta, or its tangent."""
    peak = params.metre_squared * rate
    if params.sine == 0:
        return 2.0 * peak * angle
    if not abs(angle) < ANGLE_LIMIT:
        return 0.0
    return peak * math.sin(2.0 * angle)


def axial_force(
    params: StatorForceParams, rate: NewtonPerMetre, slope: NewtonPerMetrePercent, angle: Radian
) -> Newton:
    """Give F_stator at an acting rate and its slope over stator position, N; 0 for a lost angle."""
    if not abs(angle) < ANGLE_LIMIT:
        return 0.0
    shape = math.cos(2.0 * angle) if params.sine == 1 else 1.0 - 2.0 * angle * angle
    peak = params.metre_squared * rate
    growth = params.metre_squared * slope * params.percent_per_metre
    return params.pull * abs(peak) - 0.5 * growth * shape


def slew_force(params: StatorForceParams, rate: NewtonPerMetre, angle: Radian) -> Newton:
    """Give the force on the slew load cell, N: spring torque over its lever, T/0.254 m.

    Positive for a positive rate at a positive angle, as the torque restores.
    """
    return torque(params, rate, angle) / params.slew_lever


class Reversal(NamedTuple):
    """Where the stator force changes its sign at one stator position; inf: nowhere."""

    stator: Percent
    angle: Radian  # of the rotor, either side of balance
    stroke: Metre  # heave from balance


def reversal(params: StatorForceParams, spring: SpringParams, stator: Percent) -> Reversal:
    """Give the smallest rotor angle and heave at which F_stator is zero at a stator position (%).

    The stroke limit of small spring rates; MASK4 report (Sandia), Fig. 4-3.
    """
    constant = params.pull * abs(params.metre_squared * table_rate(spring, stator))
    growth = params.metre_squared * table_slope(spring, stator) * params.percent_per_metre
    swing = 0.5 * growth
    if not abs(swing) > constant:
        return Reversal(stator, math.inf, math.inf)
    level = constant / swing  # cos 2 theta where the force is zero
    linear = math.sqrt(0.5 * (1.0 - level))
    angle = 0.5 * math.acos(level) if params.sine == 1 else linear
    return Reversal(stator, angle, angle / spring.angle_per_metre)
