"""The velocity command: what is asked -> what the drive is told, in volts, within limits."""

from typing import NamedTuple

from controllers.blocks import clamp, finite
from rig.realtime.limits import Limited
from rig.realtime.safety import ENABLING, RUN, STOP_1


class Params(NamedTuple):
    """Scale and limits of the velocity command."""

    constant: float  # rad/s per volt, measured
    most_volts: float  # V either way
    most: float  # rad/s either way
    acceleration: float  # rad/s^2, most change of the command


class State(NamedTuple):
    """Memory of the limiter."""

    velocity: float  # rad/s, granted in the tick before
    absurd: int  # 1: what was asked last was not a finite number


class Granted(NamedTuple):
    """What the drive is told."""

    velocity: float  # rad/s
    volts: float  # V
    enable: int
    limited: int  # set of `rig.realtime.limits.Limited`


def start() -> State:
    """State at switch-on: no command."""
    return State(0.0, 0)


def grant(
    params: Params, state: State, asked: float, mode: int, dt: float
) -> tuple[State, Granted]:
    """The command for an asked velocity (rad/s).

    ENABLING asks the drive on at rest; RUN and the controlled stops grant a velocity; every other
    mode takes command and power away in this very tick. What is not a finite number is granted as
    rest, and trips in the next tick.
    """
    if not RUN <= mode <= STOP_1:
        limited = 0 if asked == 0.0 else Limited.MODE.value
        return State(0.0, 0), Granted(0.0, 0.0, 1 if mode == ENABLING else 0, limited)
    if not finite(asked):
        return State(0.0, 1), Granted(0.0, 0.0, 1, Limited.NOT_FINITE.value)
    constant, most_volts, most, acceleration = params
    ceiling = most_volts * constant
    ceiling = min(ceiling, most)
    velocity, limited = clamp(asked, -ceiling, ceiling), 0
    if velocity != asked:
        limited = Limited.VELOCITY.value
    change = acceleration * dt
    within = clamp(velocity, state.velocity - change, state.velocity + change)
    if within != velocity:
        limited = limited | Limited.SLEW.value
    return State(within, 0), Granted(within, within / constant, 1, limited)
