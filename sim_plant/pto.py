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
    guide: Ratio  # Coulomb friction per lateral force that the heave guide carries
    coulomb_velocity: MetrePerSecond  # width of the regularised sign


def motor_force(params: PtoParams, current: Ampere) -> Newton:
    """Give the force on the body of a drive current: F = Kt N i. N, A."""
    return params.force_per_current * current


def copper_loss(params: PtoParams, force: Newton) -> Watt:
    """Give R i² of the winding at a motor force, W, never negative; i = F/(sqrt(3/2) Kt N).

    Source: MASK4 report (Sandia), eq. 2.5.
    """
    return params.copper * force * force


def friction(params: PtoParams, velocity: MetrePerSecond, lateral: Newton) -> Newton:
    """Give the drivetrain friction on the body: -(B v + (F_c + mu |F_lateral|) tanh(v/v_c)). N.

    `lateral` is the force that the heave guide carries in surge (N, either sign): what couples
    surge to heave. tanh instead of sign keeps the force smooth, so the midpoint rule stays second
    order and a body at rest creeps instead of chattering; v_c is far below the velocities of any
    measured row.
    """
    dry = params.coulomb + params.guide * abs(lateral)
    return -(params.viscous * velocity + dry * math.tanh(velocity / params.coulomb_velocity))
