"""Position hold: a spring and a damper to a target that moves smoothly.

    F = -K (x - x_t) - D v                             (N, force on the body)

The law is the F = Kp v + Ki x of the MASK4 report (Sandia), section 4.3, about a moving target; the
profile is the usual trapezoid of drives (CiA 402, profile position mode). In this project's signs
Ki = -K and Kp = -D, with the position relative to the target: K > 0 pulls to the target, D > 0
damps. The law keeps an axis in place, or brings it home before it is released.

x_t starts at the first measured position, and K and D are ramped from zero, so at_goal is no jolt.
x_t moves to the goal with bounded speed and acceleration (a trapezoidal profile); the goal may
change at any time.

The caller must check how large K and D may be: with a tick, a delay and an estimator in the loop
a stiff spring on a light body is unstable.

Bad input: NaN or infinity in motion or goal gives a force that is not finite, which the limits
turn into a stop; the force stays so until the hold starts afresh. An acceleration that is not
above zero leaves the target at rest.
"""

from math import sqrt
from typing import NamedTuple

from controllers.blocks import Ramp, clamp, finite, ramp_start, ramp_step
from controllers.signals import (
    Demand,
    Estimate,
    Flag,
    Metre,
    MetrePerSecond,
    MetrePerSecond2,
    NewtonPerMetre,
    NewtonSecondPerMetre,
    Second,
)

NEAR = 1e-9  # m, distance below which a target counts as at its goal


class Params(NamedTuple):
    """Constants of the hold."""

    ramp: Second  # time to ramp spring and damper up
    stiffness: NewtonPerMetre  # K >= 0
    damping: NewtonSecondPerMetre  # D >= 0
    speed: MetrePerSecond  # > 0, greatest speed of the target
    acceleration: MetrePerSecond2  # > 0, greatest acceleration of the target


class State(NamedTuple):
    """Motion of the target, and the share of the force that acts."""

    force_share: Ramp  # 0 to 1
    target: Metre
    speed: MetrePerSecond  # of the target
    initialised: Flag  # 1 after the first measured position


def start() -> State:
    """Return the state at switch-on: no force; the target starts where the axis is found."""
    return State(ramp_start(0.0), 0.0, 0.0, 0)


def rezero(state: State, shift: float) -> State:
    """Return the state relative to a zero that has moved up by ``shift`` (m)."""
    force_share, target, speed, initialised = state
    return State(force_share, target - shift, speed, initialised)


def arrived(state: State, goal: float) -> bool:
    """Return True when the target is at rest at the goal; the axis follows as well as K allows."""
    return state.initialised == 1 and state.target == goal and state.speed == 0.0


def step(
    params: Params, state: State, goal: Metre, estimate: Estimate, dt: float
) -> tuple[State, Demand]:
    """Return the force on the body (N), the target moved one tick towards ``goal`` (m)."""
    position, velocity, _ = estimate
    force_share, target, speed, initialised = state
    if initialised == 0:
        target = position
    if initialised == 0 or force_share.value != 1.0 or target != goal or speed != 0.0:
        force_share = ramp_step(force_share, 1.0, params.ramp, dt)
        target, speed = _step_target(params, target, speed, goal, dt)
        state = State(force_share, target, speed, 1)
    kp = -params.damping * force_share.value
    ki = -params.stiffness * force_share.value
    return state, Demand(kp, ki, 0.0, kp * velocity + ki * (position - target))


def _step_target(
    params: Params, target: float, speed: float, goal: float, dt: float
) -> tuple[float, float]:
    """Return the target and its speed one tick later.

    Braking by a T a tick from speed v takes the distance v^2 / 2a + v T / 2. The bound on the speed
    is the largest v whose braking distance does not exceed the remaining distance.
    """
    gap = goal - target
    if not finite(gap):
        return gap, 0.0
    remaining = gap if gap > 0.0 else -gap
    change = params.acceleration * dt
    discriminant = 0.25 * change * change + 2.0 * params.acceleration * remaining
    if not (change > 0.0 and finite(discriminant)):
        return target, 0.0
    bound = clamp(sqrt(discriminant) - 0.5 * change, 0.0, params.speed)
    speed = clamp(bound if gap > 0.0 else -bound, speed - change, speed + change)
    distance = speed * dt
    at_goal = remaining < NEAR or distance >= gap >= 0.0 or distance <= gap <= 0.0
    if at_goal and -2.0 * change < speed < 2.0 * change:  # faster: overshoot, brake, return
        return goal, 0.0
    return target + distance, speed
