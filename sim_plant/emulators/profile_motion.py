"""A point that is led along a trapezoid of speed. Pure, in any unit of length."""

from __future__ import annotations

import math
from typing import NamedTuple


class Motion(NamedTuple):
    """Where the point is and how fast it goes."""

    position: float
    velocity: float  # per second


class Profile(NamedTuple):
    """How it may move; all positive."""

    velocity: float  # per second
    acceleration: float  # per second²
    deceleration: float


def towards(motion: Motion, target: float, profile: Profile, dt: float) -> Motion:
    """Move on by dt towards a target, where it stands exactly at the end."""
    position, velocity = motion
    left = target - position
    if dt <= 0.0 or (left == 0.0 and velocity == 0.0):
        return motion
    fastest = min(profile.velocity, math.sqrt(2.0 * profile.deceleration * abs(left)))
    wanted = math.copysign(fastest, left)
    slowing = abs(wanted) < abs(velocity) or wanted * velocity < 0.0
    reach = (profile.deceleration if slowing else profile.acceleration) * dt
    velocity += max(-reach, min(reach, wanted - velocity))
    if velocity * left > 0.0 and abs(velocity) * dt >= abs(left):
        return Motion(target, 0.0)
    return Motion(position + velocity * dt, velocity)


def stopping(motion: Motion, deceleration: float, dt: float) -> Motion:
    """Move on by dt, slowing down to a stop."""
    position, velocity = motion
    after = math.copysign(max(0.0, abs(velocity) - deceleration * dt), velocity)
    if after == 0.0:
        after = 0.0
    return Motion(position + 0.5 * (velocity + after) * dt, after)
