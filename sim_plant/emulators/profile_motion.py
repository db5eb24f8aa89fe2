"""Motion of a point with a trapezoidal velocity profile. Pure, in any unit of length."""

from __future__ import annotations

import math
from typing import NamedTuple


class Motion(NamedTuple):
    """Position and velocity of the point."""

    position: float
    velocity: float  # per second


class MotionLimits(NamedTuple):
    """Motion limits; all positive."""

    velocity: float  # per second
    acceleration: float  # per second²
    deceleration: float


def step_towards(motion: Motion, target: float, limits: MotionLimits, dt: float) -> Motion:
    """Advance by dt towards a target; the motion ends at rest exactly there."""
    position, velocity = motion
    distance = target - position
    if dt <= 0.0 or (distance == 0.0 and velocity == 0.0):
        return motion
    fastest = min(limits.velocity, math.sqrt(2.0 * limits.deceleration * abs(distance)))
    target_velocity = math.copysign(fastest, distance)
    slowing = abs(target_velocity) < abs(velocity) or target_velocity * velocity < 0.0
    max_change = (limits.deceleration if slowing else limits.acceleration) * dt
    velocity += max(-max_change, min(max_change, target_velocity - velocity))
    if velocity * distance > 0.0 and abs(velocity) * dt >= abs(distance):
        return Motion(target, 0.0)
    return Motion(position + velocity * dt, velocity)


def step_to_stop(motion: Motion, deceleration: float, dt: float) -> Motion:
    """Advance by dt, decelerating to a stop."""
    position, velocity = motion
    next_velocity = math.copysign(max(0.0, abs(velocity) - deceleration * dt), velocity)
    if next_velocity == 0.0:
        next_velocity = 0.0
    return Motion(position + 0.5 * (velocity + next_velocity) * dt, next_velocity)
