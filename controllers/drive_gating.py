"""Gating of a motor drive: its power stage rests while the available power is small.

    off  when  |v| < v_threshold  and  |i| < i_threshold,    else on

A drive that does not switch consumes almost nothing; at low velocity little power is available, so
resting pays (MASK4 report, section 3.1.4: the drive is disabled while "the velocity of the motor
is less than a specified threshold"; Table 3-3, driveVelThreshold: the velocity above which it will
turn on). A commanded current of i_threshold or more keeps the drive on, because a force is
demanded; with i_threshold = 0 the velocity alone decides.

With a hysteresis h, a drive that is off turns on at (1 + h) times a threshold; h = 0, the logic of
the report, is no hysteresis.

A velocity threshold of 0 never turns the drive off, and neither does any value that is not finite:
a drive that is on obeys the limits, which turn NaN into a stop with a reason.
"""

from typing import NamedTuple

from controllers.blocks import finite
from controllers.signals import Ampere, Flag, MetrePerSecond


class Params(NamedTuple):
    """Constants of the gate."""

    current: Ampere  # threshold of the commanded drive current; 0: the velocity alone decides
    hysteresis: float  # 1, >= 0, relative increase of the thresholds for turning on


class State(NamedTuple):
    """State of the power stage."""

    conducting: Flag


def start() -> State:
    """Return the state at switch-on: the drive conducts."""
    return State(1)


def step(
    params: Params,
    state: State,
    velocity: MetrePerSecond,
    current: Ampere,
    threshold: MetrePerSecond,
) -> tuple[State, int]:
    """Return 1 if the drive shall conduct, else 0; ``current`` is the commanded current."""
    current_threshold = params.current
    if not (threshold > 0.0 and finite(threshold)):
        return State(1), 1
    if state.conducting == 0:
        threshold = threshold + params.hysteresis * threshold
        current_threshold = current_threshold + params.hysteresis * current_threshold
    low_current = current_threshold == 0.0 or -current_threshold < current < current_threshold
    if -threshold < velocity < threshold and low_current and finite(current):
        return State(0), 0
    return State(1), 1
