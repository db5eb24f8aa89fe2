"""The velocity command: a demanded velocity becomes volts of the drive's input, within limits."""

from typing import NamedTuple

from controllers.blocks import clamp, finite
from rig.realtime.limits import LimitFlag
from rig.realtime.safety import ENABLING, RUN, STOP_1


class Params(NamedTuple):
    """Scale and limits of the velocity command."""

    velocity_constant: float  # rad/s per volt, measured
    max_volts: float  # V, both directions
    max_velocity: float  # rad/s, both directions
    acceleration: float  # rad/s^2, maximum rate of change of the command


class State(NamedTuple):
    """Memory of the limiter."""

    velocity: float  # rad/s, command of the previous tick
    not_finite: int  # 1: the last demand was not a finite number


class VelocityCommand(NamedTuple):
    """The command to the drive."""

    velocity: float  # rad/s
    volts: float  # V
    enable: int
    limited: int  # set of `rig.realtime.limits.LimitFlag`


def start() -> State:
    """Return the state at switch-on: no command."""
    return State(0.0, 0)


def limit_command(
    params: Params, state: State, demand: float, mode: int, dt: float
) -> tuple[State, VelocityCommand]:
    """Return new state and command for a demanded velocity (rad/s).

    ENABLING requests power at zero velocity; RUN and the controlled stops pass a velocity; every
    other mode removes command and power in the same tick. A demand that is not finite yields zero
    velocity, and the next tick trips.
    """
    if not RUN <= mode <= STOP_1:
        limited = 0 if demand == 0.0 else LimitFlag.MODE.value
        return State(0.0, 0), VelocityCommand(0.0, 0.0, 1 if mode == ENABLING else 0, limited)
    if not finite(demand):
        return State(0.0, 1), VelocityCommand(0.0, 0.0, 1, LimitFlag.NOT_FINITE.value)
    velocity_constant, max_volts, max_velocity, acceleration = params
    ceiling = max_volts * velocity_constant
    ceiling = min(ceiling, max_velocity)
    velocity, limited = clamp(demand, -ceiling, ceiling), 0
    if velocity != demand:
        limited = LimitFlag.VELOCITY.value
    change = acceleration * dt
    slewed = clamp(velocity, state.velocity - change, state.velocity + change)
    if slewed != velocity:
        limited = limited | LimitFlag.SLEW.value
    return State(slewed, 0), VelocityCommand(slewed, slewed / velocity_constant, 1, limited)
