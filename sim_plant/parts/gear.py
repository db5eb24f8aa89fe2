"""Gears, screws and belts: backlash and the loss that grows with load. Pure.

Motion and force of the motor are at the axis: angle by gear ratio, torque times gear ratio.
"""

from __future__ import annotations

import math

from sim_plant.parts import end_stop
from sim_plant.parts.end_stop import EndStopParams
from sim_plant.units import Metre, MetrePerSecond, Newton, Ratio


def load_loss(
    efficiency: Ratio, width: MetrePerSecond, force: Newton, velocity: MetrePerSecond
) -> Newton:
    """Return the force lost under load: -(1 - efficiency) |F| tanh(v / width), against the motion.

    A motor that drives the axis delivers `efficiency` of its power; an axis that drives the motor
    has to deliver 2 - efficiency of it. This is dry friction in proportion to the load, the usual
    model of gears and screws (R. G. Budynas and J. K. Nisbett, Shigley's Mechanical Engineering
    Design, chapters 8 and 13).
    """
    return -(1.0 - efficiency) * abs(force) * math.tanh(velocity / width)


def backlash_force(params: EndStopParams, twist: Metre, rate: MetrePerSecond) -> Newton:
    """Return the force of the motor side on the axis through the teeth.

    Twist is motor minus axis (m), at most `params.position` to either side without force; beyond,
    the teeth are a spring and a damper, and they never pull.
    """
    return -end_stop.force(params, twist, rate)
