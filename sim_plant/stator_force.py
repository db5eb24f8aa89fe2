"""Axial force on the magnetic spring's stator, its reversal, and the slew force. Pure.

Torque and axial force come from one energy W(theta, z) = -1/2 Tp(z) cos 2 theta + G(z): T =
dW/dtheta = Tp sin 2 theta (restoring on the rotor), F_stator = dW/dz = F0(z) - 1/2 Tp'(z) cos 2
theta, the force that holds the stator, positive towards rising stator position. F0 = dG/dz = pull
|Tp| is chosen so that the force reverses at 45 degrees exactly where Tp is zero, later the larger
|Tp| is, and never where pull |Tp| > 1/2 |Tp'| (MASK4 report (Sandia), Fig. 4-3).
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
    """Geometry of the stator force and its division between the load cells."""

    sine: Flag  # 1: as above; 0: the linear spring's energy, cos 2 theta -> 1 - 2 theta²
    peak_torque_per_rate: float  # torque amplitude Tp per acting rate, N m per N/m
    percent_per_metre: float  # stator position per axial travel
    pull: PerMetre  # F0 per |Tp|
    slew_lever: Metre
    share_a: Ratio  # fraction of the force on load cell A; B carries the rest


def torque(params: StatorForceParams, rate: NewtonPerMetre, angle: Radian) -> NewtonMetre:
    """Return the restoring spring torque on the rotor, N m: T = Tp sin 2 theta, or its tangent."""
    peak = params.peak_torque_per_rate * rate
    if params.sine == 0:
        return 2.0 * peak * angle
    if not abs(angle) < ANGLE_LIMIT:
        return 0.0
    return peak * math.sin(2.0 * angle)


def axial_force(
    params: StatorForceParams, rate: NewtonPerMetre, slope: NewtonPerMetrePercent, angle: Radian
) -> Newton:
    """Return F_stator for an acting rate and its slope, N; 0 beyond `ANGLE_LIMIT`.

    `slope` is the derivative of the rate over stator position."""
    if not abs(angle) < ANGLE_LIMIT:
        return 0.0
    shape = math.cos(2.0 * angle) if params.sine == 1 else 1.0 - 2.0 * angle * angle
    peak = params.peak_torque_per_rate * rate
    torque_gradient = params.peak_torque_per_rate * slope * params.percent_per_metre
    return params.pull * abs(peak) - 0.5 * torque_gradient * shape


def slew_force(params: StatorForceParams, rate: NewtonPerMetre, angle: Radian) -> Newton:
    """Return the force on the slew load cell, N: spring torque over its lever, T/0.254 m.

    The force is positive for a positive rate at a positive angle, like the restoring torque.
    """
    return torque(params, rate, angle) / params.slew_lever


class ForceReversal(NamedTuple):
    """Sign change of the stator force at one stator position; inf if there is none."""

    stator: Percent
    angle: Radian  # of the rotor, either side of balance
    stroke: Metre  # heave from balance


def force_reversal(
    params: StatorForceParams, spring: SpringParams, stator: Percent
) -> ForceReversal:
    """Return the smallest rotor angle and heave at which F_stator is zero.

    `stator` is the stator position, %.

    This is the stroke limit of small spring rates; MASK4 report (Sandia), Fig. 4-3.
    """
    offset_force = params.pull * abs(params.peak_torque_per_rate * table_rate(spring, stator))
    torque_gradient = (
        params.peak_torque_per_rate * table_slope(spring, stator) * params.percent_per_metre
    )
    amplitude = 0.5 * torque_gradient
    if not abs(amplitude) > offset_force:
        return ForceReversal(stator, math.inf, math.inf)
    cos_double_angle = offset_force / amplitude  # cos 2 theta at zero force
    linear_angle = math.sqrt(0.5 * (1.0 - cos_double_angle))
    angle = 0.5 * math.acos(cos_double_angle) if params.sine == 1 else linear_angle
    return ForceReversal(stator, angle, angle / spring.angle_per_metre)
