"""Gearbox and coupling as a torsional spring with a gap. Pure.

Deflection is motor minus shaft. The torque is zero in the gap, then rises softly while the teeth
and bearings of the gearbox settle, then rises at the combined stiffness (OSWEC thesis, eq. 2.4):
the piecewise-linear relation of its Fig. 2.9.
"""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.units import NewtonMetre, NewtonMetrePerRadian, Radian


class TransmissionParams(NamedTuple):
    """Torsion parameters; the gap is `half_gap` to either side."""

    stiffness: NewtonMetrePerRadian
    half_gap: Radian
    soft_deflection: Radian  # added by settling to the deflection of the spring
    soft_torque: NewtonMetre  # at which settling has ended


def combined_stiffness(
    coupling: NewtonMetrePerRadian, shaft: NewtonMetrePerRadian, gearbox: NewtonMetrePerRadian
) -> NewtonMetrePerRadian:
    """Return the stiffness of three springs in series, N m/rad (OSWEC thesis, eq. 2.4)."""
    return 1.0 / (1.0 / coupling + 1.0 / shaft + 1.0 / gearbox)


def torque(params: TransmissionParams, deflection: Radian) -> NewtonMetre:
    """Return the torque on the shaft for a deflection (motor minus shaft)."""
    stiffness, half_gap, soft_deflection, soft_torque = params
    excess = abs(deflection) - half_gap
    if not excess > 0.0:
        return 0.0
    softness = 1.0 / stiffness + soft_deflection / soft_torque
    magnitude = excess / softness
    if magnitude > soft_torque:
        magnitude = (excess - soft_deflection) * stiffness
    return magnitude if deflection > 0.0 else -magnitude


def deflection(params: TransmissionParams, load_torque: NewtonMetre) -> Radian:
    """Return the deflection under a torque of either sign; for zero torque, half the gap."""
    stiffness, half_gap, soft_deflection, soft_torque = params
    load = abs(load_torque)
    soft_part = soft_deflection * min(load / soft_torque, 1.0)
    magnitude = half_gap + load / stiffness + soft_part
    return magnitude if load_torque >= 0.0 else -magnitude


def follow(
    params: TransmissionParams,
    motor: Radian,
    shaft: Radian,
    forward: NewtonMetre,
    back: NewtonMetre,
) -> Radian:
    """Return the shaft angle for a motor angle: dry friction holds the shaft, the spring moves it.

    `forward` and `back` (N m, not negative) are the friction torques against a positive and a
    negative torque. The inertia of the shaft is neglected: its torque is below 0.05 N m in a 1.5 s
    oscillation of 20 degrees.
    """
    twist = motor - shaft
    max_twist = deflection(params, forward)
    if twist > max_twist:
        return motor - max_twist
    min_twist = deflection(params, -back) if back > 0.0 else -params.half_gap
    if twist < min_twist:
        return motor - min_twist
    return shaft
