"""The PI (impedance) law of the MASK4 report, with ramped gains.

F = Kp v + Ki x: force on the body from measured velocity and position. Kp < 0 is damping and
absorbs power; Ki > 0 acts as a negative spring (MASK4 report, section 4.3). Ki multiplies the
measured position, not an integral, so nothing winds up; an encoder offset b gives Ki b newtons,
which is why a campaign tares first.
"""

from typing import NamedTuple

from controllers.blocks import Ramp, ramp_start, ramp_step
from controllers.signals import Demand, Estimate, Gains, Second


class Params(NamedTuple):
    """Constants of the law."""

    ramp: Second  # time a change of gains takes


class State(NamedTuple):
    """The gains in use, on their way to the set ones."""

    kp: Ramp
    ki: Ramp


def start() -> State:
    """State at switch-on: zero gains, so the first force is zero whatever is measured."""
    return State(ramp_start(0.0), ramp_start(0.0))


def step(
    params: Params, state: State, gains: Gains, estimate: Estimate, dt: float
) -> tuple[State, Demand]:
    """Force on the body (N) for the measured motion, gains ramped towards ``gains``.

    A change of gains is bumpless: the force is continuous because gains and motion are.
    """
    wanted_kp, wanted_ki, _ = gains
    position, velocity, _ = estimate
    kp, ki = state
    if kp.value == wanted_kp and ki.value == wanted_ki:  # the usual tick
        return state, Demand(wanted_kp, wanted_ki, 0.0, wanted_kp * velocity + wanted_ki * position)
    kp = ramp_step(kp, wanted_kp, params.ramp, dt)
    ki = ramp_step(ki, wanted_ki, params.ramp, dt)
    force = kp.value * velocity + ki.value * position
    return State(kp, ki), Demand(kp.value, ki.value, 0.0, force)
