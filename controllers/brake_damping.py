"""The particle brake as a linear damper: T = R |v|, and the current that gives this torque.

OSWEC thesis (University of Washington), eq. 2.1, with v the velocity of the shaft by its encoder,
filtered: v' = (v_m - v) / tau. A brake takes energy and never gives any: its torque opposes the
motion by itself, so torque and current are never negative here, whatever the sign of v. What the
brake's map cannot give (below its residual torque, above its greatest) is not asked of it.

A motor in its place (a flap's power take-off) gives the same damping with a sign, `opposing`. The
best R without a spring is the modulus of the flap's intrinsic impedance (ibid., eq. 2.2, in which
the velocity printed must be the frequency omega).

The torque of a current has two branches, rising and falling; the map is their mean, inverted.

Bad input: a velocity that is not a finite number is not heeded.
"""

from typing import NamedTuple

from controllers.blocks import clamp, finite, interpolate
from controllers.signals import Ampere, NewtonMetre, RadianPerSecond, Second


class Params(NamedTuple):
    """The brake's map and the bounds of its command."""

    torques: tuple[float, ...]  # N*m, increasing, two at least
    currents: tuple[float, ...]  # A, that give them
    slew: float  # A/s, most change of the current
    filter_time: Second  # tau > 0, of the velocity


class Braked(NamedTuple):
    """What is asked of the brake, and all that is remembered of it."""

    torque: NewtonMetre  # >= 0
    current: Ampere  # >= 0
    velocity: RadianPerSecond  # filtered


def start() -> Braked:
    """The brake let go."""
    return Braked(0.0, 0.0, 0.0)


def step(
    params: Params,
    state: Braked,
    damping: float,
    held: Ampere,
    velocity: RadianPerSecond,
    dt: float,
) -> Braked:
    """Torque and current for a ``damping`` R (N*m*s/rad) and a current ``held`` beside it (A).

    The greater of both currents is asked; the current changes by the slew at most.
    """
    torques, currents, slew, tau = params
    _, before, slow = state
    if finite(velocity):
        slow = slow + (velocity - slow) * (dt / (dt + tau))
    last = len(torques) - 1
    wanted = held
    if damping > 0.0:
        speed = slow if slow > 0.0 else -slow
        asked = interpolate(clamp(damping * speed, 0.0, torques[last]), torques, currents)
        wanted = asked if asked > held else held
    change = slew * dt
    current = clamp(clamp(wanted, before - change, before + change), 0.0, currents[last])
    return Braked(interpolate(current, currents, torques), current, slow)


def opposing(damping: float, velocity: RadianPerSecond) -> NewtonMetre:
    """Torque of a motor on the shaft for a ``damping`` R >= 0 (N*m*s/rad): -R v."""
    return -damping * velocity
