"""Unwrapping of single-turn counts into a multi-turn angle, with a plausibility check of speed.

The change from the last accepted count is the one of at most half a turn. The count is accepted if
the machine can reach that speed. Otherwise it is a jump: rejected and counted, and the last
position stands. The longer no count is accepted, the further the machine may have moved; once that
is half a turn, the number of turns is unknown and the angle is lost, until a new `start`.
"""

import math
from enum import IntEnum
from typing import NamedTuple


class Outcome(IntEnum):
    """Result of one count."""

    ACCEPTED = 0
    JUMPED = 1  # further than the speed limit allows
    OUT_OF_TURN = 2  # outside 0 to counts_per_turn - 1
    BACK_IN_TIME = 3  # time stamp before the last accepted one
    LOST = 4  # the number of turns is unknown; no further count is accepted


class Params(NamedTuple):
    """Resolution of the encoder and speed limit of the machine."""

    counts_per_turn: int  # 524288 for 19 bits
    max_speed: float  # rad/s, > 0; well above normal speeds, below half a turn per sample
    slack: float  # counts, >= 0: tolerance for noise and error of the time stamps


class State(NamedTuple):
    """The last accepted count, turns included, and counts of rejected samples."""

    known: int  # 0 until the first count
    lost: int
    position: int  # counts, unbounded
    time_us: int  # time of that count
    jumped: int
    out_of_turn: int
    back_in_time: int


def start() -> State:
    """Return the state before the first count, with which the angle begins within 0 to 2 pi."""
    return State(0, 0, 0, 0, 0, 0, 0)


def step(params: Params, state: State, position: int, time_us: int) -> tuple[State, Outcome]:
    """Return state and outcome after one single-turn count and its time (us, any origin)."""
    known, lost, last, last_us, jumped, out_of_turn, back_in_time = state
    turn = params.counts_per_turn
    if lost:
        return state, Outcome.LOST
    if not 0 <= position < turn:
        return state._replace(out_of_turn=out_of_turn + 1), Outcome.OUT_OF_TURN
    if not known:
        return state._replace(known=1, position=position, time_us=time_us), Outcome.ACCEPTED
    gap_us = time_us - last_us
    if gap_us < 0:
        return state._replace(back_in_time=back_in_time + 1), Outcome.BACK_IN_TIME
    max_move = params.slack + params.max_speed * gap_us * 1e-6 * turn / math.tau
    if 2.0 * max_move >= turn:
        return state._replace(lost=1), Outcome.LOST
    move = (position - last) % turn
    if 2 * move > turn:
        move -= turn
    if not -max_move <= move <= max_move:
        return state._replace(jumped=jumped + 1), Outcome.JUMPED
    accepted = State(known, lost, last + move, time_us, jumped, out_of_turn, back_in_time)
    return accepted, Outcome.ACCEPTED


def angle(params: Params, state: State) -> float:
    """Return the angle (rad, positive as the encoder counts) of the last accepted count.

    The angle includes the turns.
    """
    return state.position * (math.tau / params.counts_per_turn)
