"""Checks of a motor's power, averaged over some seconds.

Scale: the power by the motor's current, compared with that by a force sensor next to it. Their
difference is known: friction between them (a few watts and a share of the power), and energy that
is stored (`rig.realtime.average` states how much). An inverted or dead sensor, or a motor whose
force does not agree with its current, is therefore detected in any motion; at rest there is no
power to compare. A motor of unknown force allows no controlled stop.

Sign: the power that a law which can only absorb feeds into the body is never positive on average.
Where it is, the motor drives the body, and so would the damping of a controlled stop.
"""

from typing import NamedTuple

from rig.realtime import average
from rig.realtime.reasons import NO_REASON, Reason
from rig.realtime.safety import RUN, STOP_1

_FORCE = Reason.FORCE_DISAGREES.value
_SIGN = Reason.POWER_SIGN.value


class Params(NamedTuple):
    """Limits of the averages."""

    weight: float  # share of a tick in the averages
    fed_stop: float  # W, into the body by a law that absorbs
    difference_stop: float  # W, between motor and sensor
    difference_ratio: float  # 1, the same as a share of the sensor's power


class State(NamedTuple):
    """Averages, W."""

    fed: float  # into the body by a law that absorbs
    difference: float  # motor less sensor
    magnitude: float  # of the sensor's power
    reason: int  # to stop, or NONE


_ZERO_POWER = State(0.0, 0.0, 0.0, NO_REASON)


def start() -> State:
    """Return the state at switch-on: no power."""
    return _ZERO_POWER


def step(params: Params, state: State, fed: float, motor: float, sensor: float, mode: int) -> State:
    """Update the averages with this tick's powers (W); return them and the reason to stop.

    ``fed`` is 0 while the law is not one that can only absorb. Without power on the drive the
    averages are reset.
    """
    if not RUN <= mode <= STOP_1:
        return _ZERO_POWER
    weight, fed_stop, difference_stop, ratio = params
    mean_fed, difference, magnitude, _ = state
    mean_fed = average.step(mean_fed, fed, weight)
    difference = average.step(difference, motor - sensor, weight)
    magnitude = average.step(magnitude, abs(sensor), weight)
    reason = NO_REASON
    max_difference = difference_stop + ratio * magnitude
    if not -max_difference <= difference <= max_difference:
        reason = _FORCE
    elif mean_fed > fed_stop:
        reason = _SIGN
    return State(mean_fed, difference, magnitude, reason)
