"""End stops: a spring and a damper beyond a position to either side. Pure."""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.units import Metre, MetrePerSecond, Newton, NewtonPerMetre, NewtonSecondPerMetre

FAR = 1.0e30  # position of an end stop that is not there


class EndStopParams(NamedTuple):
    """Two equal stops at ± position; for a rotation read rad for m and N m for N."""

    position: Metre
    stiffness: NewtonPerMetre
    damping: NewtonSecondPerMetre


def force(params: EndStopParams, position: Metre, velocity: MetrePerSecond) -> Newton:
    """Return the force on what has hit a stop, zero between them; a stop never pulls."""
    limit, stiffness, damping = params
    if position > limit:
        return -max(stiffness * (position - limit) + damping * velocity, 0.0)
    if position < -limit:
        return max(stiffness * (-limit - position) - damping * velocity, 0.0)
    return 0.0
