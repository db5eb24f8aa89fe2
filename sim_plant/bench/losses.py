"""Friction of the bearing and of the optional seal behind the load cell. Pure.

The friction differs between the directions and grows slightly with speed (OSWEC thesis, 3.2.2:
less than 0.4 N m, more counter-clockwise than clockwise).
"""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.units import NewtonMetre, NewtonMetreSecondPerRadian, RadianPerSecond


class DragParams(NamedTuple):
    """Friction of one component."""

    clockwise: NewtonMetre  # dry friction for motion in positive direction
    counterclockwise: NewtonMetre
    viscous: NewtonMetreSecondPerRadian


def forward_torque(params: DragParams, velocity: RadianPerSecond) -> NewtonMetre:
    """Return the friction torque against motion in positive direction, not negative."""
    return params.clockwise + params.viscous * abs(velocity)


def backward_torque(params: DragParams, velocity: RadianPerSecond) -> NewtonMetre:
    """Return the friction torque against motion in negative direction, not negative."""
    return params.counterclockwise + params.viscous * abs(velocity)
