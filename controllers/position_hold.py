"""Position hold: a spring and a damper to a target that moves smoothly.

    F = -K (x - x_t) - D v                             (N, force on the body)

The law is the F = Kp v + Ki x of the MASK4 report (Sandia), section 4.3, about a moving target; the
profile is the usual trapezoid of drives (CiA 402, profile position mode).
In the signs of the house this is Ki = -K and Kp = -D, with the position taken from the target:
K > 0 pulls to it, D > 0 damps. It keeps an axis in place, or brings it home before it is released.

x_t starts at the first position seen and K and D are ramped from nothing, so there is no jolt. It
goes to the goal with bounded speed and acceleration (a trapezoidal profile: speed up, go on, slow
down so as to stop there); a new goal may come at any time.

How large K and D may be is the caller's check: with a tick, a delay and an estimator in the loop
a stiff spring on a light body is unstable.

Bad input: NaN or infinity in motion or goal gives a force that is not finite, which the limits
turn into a stop; it stays so until the hold starts afresh. An acceleration that is not above zero
leaves the target where it is.
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

NEAR = 1e-9  # m, a target so near its goal stands there


class Params(NamedTuple):
    """Constants of the hold."""

    ramp: Second  # time in which spring and damper come up
    stiffness: NewtonPerMetre  # K >= 0
    damping: NewtonSecondPerMetre  # D >= 0
    speed: MetrePerSecond  # > 0, most of the target
    acceleration: MetrePerSecond2  # > 0, most of the target


class State(NamedTuple):
    """Where the target is and how much of the force is in use."""

    share: Ramp  # 0 to 1
    target: Metre
    speed: MetrePerSecond  # of the target
    seeded: Flag  # 1 once a position was seen


def start() -> State:
    """State at switch-on: no force, the target where the axis will be found."""
    return State(ramp_start(0.0), 0.0, 0.0, 0)


def rezero(state: State, by: float) -> State:
    """The same hold seen from a zero that has moved up by ``by`` (m)."""
    share, target, speed, seeded = state
    return State(share, target - by, speed, seeded)


def arrived(state: State, goal: float) -> bool:
    """True when the target stands at the goal; the axis follows as well as K lets it."""
    return state.seeded == 1 and state.target == goal and state.speed == 0.0


def step(
    params: Params, state: State, goal: Metre, estimate: Estimate, dt: float
) -> tuple[State, Demand]:
    """Force on the body (N), the target moved one tick towards ``goal`` (m)."""
    position, velocity, _ = estimate
    share, target, speed, seeded = state
    if seeded == 0:
        target = position
    if seeded == 0 or share.value != 1.0 or target != goal or speed != 0.0:
        share = ramp_step(share, 1.0, params.ramp, dt)
        target, speed = _moved(params, target, speed, goal, dt)
        state = State(share, target, speed, 1)
    kp = -params.damping * share.value
    ki = -params.stiffness * share.value
    return state, Demand(kp, ki, 0.0, kp * velocity + ki * (position - target))


def _moved(
    params: Params, target: float, speed: float, goal: float, dt: float
) -> tuple[float, float]:
    """Target and its speed one tick later.

    Braking by a T a tick from speed v covers v^2 / 2a + v T / 2: the largest v whose braking way
    is not longer than what is left is the bound on the speed.
    """
    gap = goal - target
    if not finite(gap):
        return gap, 0.0
    left = gap if gap > 0.0 else -gap
    change = params.acceleration * dt
    inside = 0.25 * change * change + 2.0 * params.acceleration * left
    if not (change > 0.0 and finite(inside)):
        return target, 0.0
    bound = clamp(sqrt(inside) - 0.5 * change, 0.0, params.speed)
    speed = clamp(bound if gap > 0.0 else -bound, speed - change, speed + change)
    way = speed * dt
    there = left < NEAR or way >= gap >= 0.0 or way <= gap <= 0.0
    if there and -2.0 * change < speed < 2.0 * change:  # else it goes past, brakes and comes back
        return goal, 0.0
    return target + way, speed
