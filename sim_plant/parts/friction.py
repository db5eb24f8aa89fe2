"""Viscous and Coulomb friction of a bearing, seal, guide or motor. Pure.

F = -(B v + F_c tanh(v / v_c)). The tanh in the place of the sign keeps the force smooth: the
midpoint rule stays of second order, and a body at rest creeps instead of chattering.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_plant.units import MetrePerSecond, Newton, NewtonSecondPerMetre


class FrictionParams(NamedTuple):
    """Friction of one part; for a rotation read rad for m and N m for N."""

    viscous: NewtonSecondPerMetre
    coulomb: Newton
    width: MetrePerSecond  # v_c, of the regularised sign


def force(params: FrictionParams, velocity: MetrePerSecond) -> Newton:
    """Return the friction force, against the motion."""
    return -(params.viscous * velocity + params.coulomb * math.tanh(velocity / params.width))
