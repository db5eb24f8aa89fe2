"""Springs between an axis and the ground: coil, air and torsion springs, and the magnetic spring.

A linear spring is F = F_0 - k x. The magnetic spring has a rotor on a pinion, theta = x / r, in a
stator at z; both forces are those of one energy, W(theta, z) = -1/2 Tp(z) cos 2 theta + G(z):

    F = -Tp(z) sin 2 theta / r                 on the axis
    F_s = 1/2 Tp'(z) cos 2 theta - G'(z)       on the stator

so that what the axis loses to a moving stator the stator gains. It is the spring of the WaveBot:
`sim_plant/stator_force.py` has both laws and their source. Negative rates tune a body down.
"""

from __future__ import annotations

from typing import NamedTuple

from sim_plant import stator_force
from sim_plant.stator_force import StatorForceParams
from sim_plant.units import Metre, Newton, NewtonPerMetre, PerMetre, RadianPerMetre


class SpringParams(NamedTuple):
    """A linear spring; for a rotation read rad for m and N m for N."""

    rate: NewtonPerMetre
    preload: Newton  # on the axis at its position 0


class MagneticParams(NamedTuple):
    """Pinion and torque of a magnetic spring."""

    angle_per_metre: RadianPerMetre  # rotor angle per position of the axis, 1 / pinion radius
    peak_torque_per_rate: float  # torque amplitude Tp per rate of the table, N m per N/m
    pull: PerMetre  # G' per |Tp|


class MagneticForces(NamedTuple):
    """Forces of a magnetic spring on both its sides."""

    axis: Newton
    stator: Newton  # positive towards rising stator position


def force(params: SpringParams, position: Metre) -> Newton:
    """Return the force of a linear spring on its axis."""
    return params.preload - params.rate * position


def magnetic_forces(
    params: MagneticParams, rate: NewtonPerMetre, slope: float, position: Metre
) -> MagneticForces:
    """Return the forces at a rate of the table and its slope over stator position, N/m per m."""
    law = StatorForceParams(1, params.peak_torque_per_rate, 1.0, params.pull, 1.0, 0.0)
    angle = params.angle_per_metre * position
    return MagneticForces(
        -params.angle_per_metre * stator_force.torque(law, rate, angle),
        -stator_force.axial_force(law, rate, slope, angle),
    )
