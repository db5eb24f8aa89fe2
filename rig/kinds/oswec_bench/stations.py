"""Power of the bench's motor by its current and by the load cell, averaged over some seconds.

    Kt i v    the motor's, at the gearbox output          tz v    what leaves by the load cell

What is between the two is known: friction of gearbox and bearing, a few watts and a share of the
torque (OSWEC thesis (University of Washington), 3.1.2), and the motor's inertia, which stores next
to nothing. An inverted or dead load cell, a motor that gives another torque than its current says,
do not go together. On a clamped shaft, or one that hardly turns, there is no power to compare.

Power sign: while the motor is nothing but the damping of a flap's power take-off, power only comes
in, tz v < 0 on the average. Where it does not, the damping pushes the flap on.
"""

from typing import NamedTuple

from rig.realtime import average
from rig.realtime.safety import FINE, RUN, STOP_1, Reason

_FORCE = Reason.FORCE_DISAGREES.value
_SIGN = Reason.POWER_SIGN.value


class Params(NamedTuple):
    """Scale and limits."""

    newest: float  # share of a tick in the averages
    fed_stop: float  # W, into a flap by its power take-off
    motor_stop: float  # W, between motor current and load cell
    motor_ratio: float  # 1, the same as a share of the load cell's power
    torque_constant: float  # N*m/A


class State(NamedTuple):
    """Averages, W."""

    fed: float  # out of the load cell while the motor only damps
    motor: float  # Kt i v less tz v
    size: float  # |tz v|
    reason: int  # to stop, or NONE


_NOTHING = State(0.0, 0.0, 0.0, FINE)


def start() -> State:
    """State at switch-on: no power anywhere."""
    return _NOTHING


def step(
    params: Params,
    state: State,
    current: float,
    torque: float,
    velocity: float,
    damps: bool,
    mode: int,
) -> State:
    """Averages with this tick in them, and the reason to stop that they give.

    ``torque`` is the load cell's tz less its zero (N*m), ``velocity`` the motor's (rad/s);
    ``damps`` says that the motor is nothing but a power take-off now. Without power on the drive
    nothing is averaged.
    """
    if not RUN <= mode <= STOP_1:
        return _NOTHING
    newest, fed_stop, motor_stop, ratio, constant = params
    fed, motor, size, _ = state
    power = torque * velocity
    fed = average.step(fed, power if damps else 0.0, newest)
    motor = average.step(motor, constant * current * velocity - power, newest)
    size = average.step(size, abs(power), newest)
    reason = FINE
    apart = motor_stop + ratio * size
    if not -apart <= motor <= apart:
        reason = _FORCE
    elif fed > fed_stop:
        reason = _SIGN
    return State(fed, motor, size, reason)
