"""Passive forces of the plant over records, row by row: vectorised forms of `sim_plant`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rig.design.grid import Floats


class Spring(NamedTuple):
    """The magnetic spring, one effective rate per row."""

    rate: Floats  # N/m, rows by 1
    reach: float  # m, force amplitude divided by rate
    angle_per_metre: float  # rad/m
    sine: int  # 1: sin 2 theta, 0: linear


class Friction(NamedTuple):
    """Coulomb friction; ``size`` may vary over the record."""

    size: Floats  # N, broadcast over rows and samples
    velocity: float  # m/s, width of the regularised sign


def spring_force(spring: Spring, x: Floats) -> Floats:
    """Return the spring force on the body, N (`sim_plant.magnetic_spring.force`)."""
    if spring.sine == 0:
        return -spring.rate * x
    force: Floats = -spring.rate * spring.reach * np.sin(2.0 * spring.angle_per_metre * x)
    return force


def friction_force(friction: Friction, v: Floats) -> Floats:
    """Return the drivetrain's Coulomb friction on the body, N (`sim_plant.pto.friction`)."""
    force: Floats = -friction.size * np.tanh(v / friction.velocity)
    return force


def drag_force(quadratic: float, v: Floats) -> Floats:
    """Return the quadratic part of the viscous force on the body, N (`sim_plant.body.drag`)."""
    return -quadratic * np.abs(v) * v


def stiffness_at_rest(spring: Spring) -> Floats:
    """Return the stiffness at rest, N/m, one value per row."""
    factor = 2.0 * spring.reach * spring.angle_per_metre if spring.sine == 1 else 1.0
    rates: Floats = spring.rate[:, 0] * factor
    return rates
