"""The particle brake as a linear damper: T = R |v|, and the current that gives this torque.

OSWEC thesis (University of Washington), eq. 2.1, with v the filtered velocity of the shaft by its
encoder: v' = (v_m - v) / tau. A brake only dissipates energy: its torque opposes the motion by
itself, so torque and current are never negative here, whatever the sign of v. The law never
demands a torque outside the brake's map (below the residual torque, above the greatest torque).

A motor instead of the brake (a flap's power take-off) gives the same damping with a sign,
`motor_damping_torque`. The best R without a spring is the modulus of the flap's intrinsic impedance
(ibid., eq. 2.2, in which the printed velocity must be the frequency omega).

The torque has two branches over the current, rising and falling; the map is the inverse of their
mean.

Bad input: the law ignores a velocity that is not a finite number.
"""

from typing import NamedTuple

from controllers.blocks import clamp, finite, interpolate
from controllers.signals import Ampere, NewtonMetre, RadianPerSecond, Second


class Params(NamedTuple):
    """The brake's map and the bounds of its command."""

    torques: tuple[float, ...]  # N*m, increasing, at least two
    currents: tuple[float, ...]  # A, current for each torque
    slew: float  # A/s, greatest rate of change of the current
    filter_time: Second  # tau > 0, time constant of the velocity filter


class BrakeState(NamedTuple):
    """Demand to the brake; also all of the law's memory."""

    torque: NewtonMetre  # >= 0
    current: Ampere  # >= 0
    velocity: RadianPerSecond  # filtered


def start() -> BrakeState:
    """Return the released brake."""
    return BrakeState(0.0, 0.0, 0.0)


def step(
    params: Params,
    state: BrakeState,
    damping: float,
    hold_current: Ampere,
    velocity: RadianPerSecond,
    dt: float,
) -> BrakeState:
    """Return the demand for a ``damping`` R (N*m*s/rad) and at least ``hold_current`` (A).

    The demand is the greater of both currents; the slew limit bounds its change.
    """
    torques, currents, slew, tau = params
    _, last_current, filtered = state
    if finite(velocity):
        filtered = filtered + (velocity - filtered) * (dt / (dt + tau))
    last = len(torques) - 1
    target = hold_current
    if damping > 0.0:
        speed = filtered if filtered > 0.0 else -filtered
        damping_current = interpolate(clamp(damping * speed, 0.0, torques[last]), torques, currents)
        target = damping_current if damping_current > hold_current else hold_current
    change = slew * dt
    current = clamp(
        clamp(target, last_current - change, last_current + change), 0.0, currents[last]
    )
    return BrakeState(interpolate(current, currents, torques), current, filtered)


def motor_damping_torque(damping: float, velocity: RadianPerSecond) -> NewtonMetre:
    """Return the torque of a motor on the shaft for a ``damping`` R >= 0 (N*m*s/rad): -R v."""
    return -damping * velocity
