"""Comparison of the motor's power by current with that by the load cell, averaged over some
seconds.

    Kt i v    motor power at the gearbox output          tz v    power through the load cell

The difference of the two is known: friction of gearbox and bearing, a few watts and a share of the
torque (OSWEC thesis (University of Washington), 3.1.2), and the motor's inertia, which stores
almost nothing. An inverted or dead load cell, or a motor whose torque does not match its current,
breaks this balance. On a shaft that is clamped or hardly turns there is no power to compare.

Power sign: while the motor acts only as the damping of a flap's power take-off, power flows only
into the motor: tz v < 0 on average. A positive average means that the damping drives the flap.
"""

from typing import NamedTuple

from rig.realtime import average
from rig.realtime.reasons import NO_REASON, Reason
from rig.realtime.safety import RUN, STOP_1

_FORCE = Reason.FORCE_DISAGREES.value
_SIGN = Reason.POWER_SIGN.value


class Params(NamedTuple):
    """Scale and limits."""

    average_weight: float  # weight of the newest tick in the averages
    fed_power_stop: float  # W, mean power from the power take-off into the flap
    difference_stop: float  # W, difference between motor and load cell
    difference_ratio: float  # 1, permitted share of the load cell's power
    torque_constant: float  # N*m/A


class State(NamedTuple):
    """Averages, W."""

    fed_power: float  # mean of tz v while the motor only damps
    difference: float  # mean of Kt i v less tz v
    cell_power: float  # mean of |tz v|
    reason: int  # to stop, or NONE


_ZERO_POWER = State(0.0, 0.0, 0.0, NO_REASON)


def start() -> State:
    """Return the state at switch-on: zero power."""
    return _ZERO_POWER


def step(
    params: Params,
    state: State,
    current: float,
    torque: float,
    velocity: float,
    damps_only: bool,
    mode: int,
) -> State:
    """Return averages that include this tick, and the reason to stop that they give.

    ``torque`` is the load cell's tz less its zero (N*m), ``velocity`` the motor's (rad/s).
    ``damps_only`` is True while the motor is a power take-off and nothing else. Without power on
    the drive the averages are reset.
    """
    if not RUN <= mode <= STOP_1:
        return _ZERO_POWER
    weight, fed_power_stop, difference_stop, difference_ratio, torque_constant = params
    fed_power, difference, cell_power, _ = state
    power = torque * velocity
    fed_power = average.step(fed_power, power if damps_only else 0.0, weight)
    difference = average.step(difference, torque_constant * current * velocity - power, weight)
    cell_power = average.step(cell_power, abs(power), weight)
    reason = NO_REASON
    max_difference = difference_stop + difference_ratio * cell_power
    if not -max_difference <= difference <= max_difference:
        reason = _FORCE
    elif fed_power > fed_power_stop:
        reason = _SIGN
    return State(fed_power, difference, cell_power, reason)
