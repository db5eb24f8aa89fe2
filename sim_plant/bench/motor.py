"""Motor, rotor and gearbox as one inertia at the output, and what moves it. Pure.

One linearly implicit step: friction holds exactly, and no stiffness of the coupling makes it ring.
"""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.bench import transmission
from sim_plant.bench.transmission import TransmissionParams
from sim_plant.units import (
    Ampere,
    KilogramSquareMetre,
    NewtonMetre,
    NewtonMetrePerAmpere,
    NewtonMetreSecondPerRadian,
    Radian,
    RadianPerSecond,
    Second,
)


class MotorParams(NamedTuple):
    """Constants at the gearbox output."""

    inertia: KilogramSquareMetre
    viscous: NewtonMetreSecondPerRadian
    torque_per_current: NewtonMetrePerAmpere
    top_speed: RadianPerSecond  # where the drive has no voltage left to drive it faster


class Held(NamedTuple):
    """What the shaft's side does to the motor in a step."""

    ahead: Radian  # deflection at its start
    forward: NewtonMetre  # what dry friction behind the load cell holds, both not negative
    back: NewtonMetre


def ceiling(params: MotorParams, limit: Ampere, asked: Ampere, speed: RadianPerSecond) -> Ampere:
    """Give the most current that the drive's voltage allows: less in the last 5 % of the speed."""
    if not asked * speed > 0.0:
        return limit  # braking
    left = (params.top_speed - abs(speed)) / (0.05 * params.top_speed)
    return limit * max(0.0, min(left, 1.0))


def load_at(spring: TransmissionParams, held: Held, moved: Radian) -> NewtonMetre:
    """Give the torque through the coupling after a movement: the spring's, or friction's."""
    wound = transmission.torque(spring, held.ahead + moved)
    return max(-held.back, min(wound, held.forward))


def needed(
    params: MotorParams,
    spring: TransmissionParams,
    held: Held,
    now: RadianPerSecond,
    after: RadianPerSecond,
    friction: NewtonMetre,
    dt: Second,
) -> NewtonMetre:
    """Give the motor torque that makes the velocity `after` of `now` within dt."""
    inertial = params.inertia * (after - now) / dt + params.viscous * after
    rubbing = friction if after > 0.0 else (-friction if after < 0.0 else 0.0)
    return inertial + rubbing + load_at(spring, held, after * dt)


def moved(
    params: MotorParams,
    spring: TransmissionParams,
    held: Held,
    now: RadianPerSecond,
    torque: NewtonMetre,
    friction: NewtonMetre,
    dt: Second,
) -> RadianPerSecond:
    """Give the velocity after dt under a motor torque."""
    before = load_at(spring, held, 0.0)
    mass = params.inertia + dt * params.viscous
    free = (params.inertia * now + dt * (torque - before)) / mass
    way = free * dt
    slope = 0.0  # of the load over the way that the motor would go
    if abs(way) > 1.0e-12:
        slope = (load_at(spring, held, way) - before) / way
    mass += dt * dt * slope
    push = params.inertia * now + dt * (torque - before)
    rub = dt * friction
    if push > rub:
        return (push - rub) / mass
    if push < -rub:
        return (push + rub) / mass
    return 0.0
