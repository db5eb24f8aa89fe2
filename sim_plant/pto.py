"""Power take-off in heave: motor force, copper loss, drivetrain friction. Pure.

The column load cell (LCB) measures motor + magnetic spring + friction, the torque sensor (TRS)
measures the motor alone.
"""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.parts import friction as friction_part
from sim_plant.parts.friction import FrictionParams
from sim_plant.units import (
    Ampere,
    MetrePerSecond,
    Newton,
    NewtonPerAmpere,
    NewtonSecondPerMetre,
    Ratio,
    Watt,
    WattPerNewtonSquared,
)


class PtoParams(NamedTuple):
    """Motor and drivetrain constants."""

    force_per_current: NewtonPerAmpere  # Kt N, for the drive current
    copper: WattPerNewtonSquared  # R / (3/2 Kt² N²)
    viscous: NewtonSecondPerMetre
    coulomb: Newton
    guide_friction: Ratio  # Coulomb friction per lateral force on the heave guide
    coulomb_velocity: MetrePerSecond  # width of the regularised sign


def motor_force(params: PtoParams, current: Ampere) -> Newton:
    """Return the force on the body for a drive current (A): F = Kt N i, N."""
    return params.force_per_current * current


def copper_loss(params: PtoParams, force: Newton) -> Watt:
    """Return R i² of the winding at a motor force, W, never negative; i = F/(sqrt(3/2) Kt N).

    Source: MASK4 report (Sandia), eq. 2.5.
    """
    return params.copper * force * force


def friction(params: PtoParams, velocity: MetrePerSecond, lateral_force: Newton) -> Newton:
    """Return the drivetrain friction on the body: -(B v + (F_c + mu |F_lateral|) tanh(v/v_c)). N.

    `lateral_force` is the force on the heave guide in surge (N, either sign): it couples surge to
    heave. v_c is far below the velocities of any measured row.
    """
    dry_friction = params.coulomb + params.guide_friction * abs(lateral_force)
    return friction_part.force(
        FrictionParams(params.viscous, dry_friction, params.coulomb_velocity), velocity
    )
