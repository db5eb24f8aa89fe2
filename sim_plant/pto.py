"""Power take-off in heave: motor force, copper loss, drivetrain friction. Pure.

The column load cell (LCB) sees motor + magnetic spring + friction, the torque sensor (TRS) the
motor alone.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_plant.units import (
    Ampere,
    MetrePerSecond,
    Newton,
    NewtonPerAmpere,
    NewtonSecondPerMetre,
    Watt,
    WattPerNewtonSquared,
)


class PtoParams(NamedTuple):
    """Motor and drivetrain constants."""

    force_per_current: NewtonPerAmpere  # Kt N, for the drive current
    copper: WattPerNewtonSquared  # R / (3/2 Kt² N²)
    viscous: NewtonSecondPerMetre
    coulomb: Newton
    coulomb_velocity: MetrePerSecond  # width of the regularised sign


def motor_force(params: PtoParams, current: Ampere) -> Newton:
    """Give the force on the body of a drive current: F = Kt N i. N, A."""
    return params.force_per_current * current


def copper_loss(params: PtoParams, force: Newton) -> Watt:
    """Give R i² of the winding at a motor force, W, never negative; i = F/(sqrt(3/2) Kt N).

    Source: MASK4 report (Sandia), eq. 2.5.
    """
    return params.copper * force * force


def friction(params: PtoParams, velocity: MetrePerSecond) -> Newton:
    """Give the drivetrain friction on the body: -(B v + F_c tanh(v/v_c)). N.

    tanh instead of sign keeps the force smooth, so the midpoint rule stays second order and a body
    at rest creeps instead of chattering; v_c is far below the velocities of any measured row.
    """
    return -(
        params.viscous * velocity + params.coulomb * math.tanh(velocity / params.coulomb_velocity)
    )
