"""Gating a motor drive: its power stage rests while there is too little to gain.

    off  when  |v| < v_threshold  and  |i| < i_threshold,    else on

A drive that does not switch spends next to nothing; at low velocity little power is available, so
resting pays (MASK4 report, section 3.1.4: the drive is disabled while "the velocity of the motor
is less than a specified threshold"; Table 3-3, driveVelThreshold: the velocity above which it will
turn on). A commanded current of i_threshold or more keeps it on, because a force was asked for;
i_threshold = 0 leaves the velocity alone to decide.

With a hysteresis h, a drive that is off turns on at (1 + h) times a threshold; 0, the report's
logic, is none.

A velocity threshold of 0 never turns the drive off, and neither does anything that is not a finite
number: a drive that is on obeys the limits, which turn NaN into a stop with a reason.
"""

from typing import NamedTuple

from controllers.blocks import finite
from controllers.signals import Ampere, Flag, MetrePerSecond


class Params(NamedTuple):
    """Constants of the gate."""

    current: Ampere  # threshold of the commanded drive current, 0: velocity alone
    hysteresis: float  # 1, >= 0: how much more than a threshold turns it on again


class State(NamedTuple):
    """Whether the drive conducts."""

    conducting: Flag


def start() -> State:
    """State at switch-on: the drive conducts."""
    return State(1)


def step(
    params: Params,
    state: State,
    velocity: MetrePerSecond,
    current: Ampere,
    threshold: MetrePerSecond,
) -> tuple[State, int]:
    """1 while the drive shall conduct, 0 while it rests; ``current`` is the commanded one."""
    held = params.current
    if not (threshold > 0.0 and finite(threshold)):
        return State(1), 1
    if state.conducting == 0:
        threshold = threshold + params.hysteresis * threshold
        held = held + params.hysteresis * held
    little = held == 0.0 or -held < current < held
    if -threshold < velocity < threshold and little and finite(current):
        return State(0), 0
    return State(1), 1
