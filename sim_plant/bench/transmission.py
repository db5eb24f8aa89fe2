"""Gearbox and coupling as a torsional spring with a gap: torque of a deflection and back. Pure.

Deflection is motor minus shaft. Over it the torque is zero in the gap, then rises softly while the
teeth and bearings of the gearbox settle, then at the combined stiffness (OSWEC thesis, eq. 2.4):
the piecewise-linear relation of its Fig. 2.9.
"""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.units import NewtonMetre, NewtonMetrePerRadian, Radian


class TransmissionParams(NamedTuple):
    """Torsion constants; the gap is `half_gap` to either side."""

    stiffness: NewtonMetrePerRadian
    half_gap: Radian
    soft_deflection: Radian  # what settling adds to the spring's own deflection
    soft_torque: NewtonMetre  # where settling has ended


def combined_stiffness(
    coupling: NewtonMetrePerRadian, shaft: NewtonMetrePerRadian, gearbox: NewtonMetrePerRadian
) -> NewtonMetrePerRadian:
    """Give the stiffness of three springs in series, N m/rad (OSWEC thesis, eq. 2.4)."""
    return 1.0 / (1.0 / coupling + 1.0 / shaft + 1.0 / gearbox)


def torque(params: TransmissionParams, deflection: Radian) -> NewtonMetre:
    """Give the torque on the shaft of a deflection (motor minus shaft)."""
    stiffness, half_gap, soft, end = params
    wound = abs(deflection) - half_gap
    if not wound > 0.0:
        return 0.0
    softness = 1.0 / stiffness + soft / end
    held = wound / softness
    if held > end:
        held = (wound - soft) * stiffness
    return held if deflection > 0.0 else -held


def deflection(params: TransmissionParams, held: NewtonMetre) -> Radian:
    """Give the deflection under a torque of either sign; for none, half the gap."""
    stiffness, half_gap, soft, end = params
    load = abs(held)
    settled = soft * min(load / end, 1.0)
    wound = half_gap + load / stiffness + settled
    return wound if held >= 0.0 else -wound


def follow(
    params: TransmissionParams,
    motor: Radian,
    shaft: Radian,
    forward: NewtonMetre,
    back: NewtonMetre,
) -> Radian:
    """Give where the shaft stands behind a motor: dry friction holds it, the spring moves it.

    `forward` and `back` (N m, not negative) are what friction holds against a positive and a
    negative torque. The shaft's own inertia is left out: its torque is below 0.05 N m in a 1.5 s
    oscillation of 20 degrees.
    """
    ahead = motor - shaft
    most = deflection(params, forward)
    if ahead > most:
        return motor - most
    least = deflection(params, -back) if back > 0.0 else -params.half_gap
    if ahead < least:
        return motor - least
    return shaft
