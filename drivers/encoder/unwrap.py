"""From counts of one turn to an angle of many, refusing what the machine cannot have done.

A new count is taken as the nearest one to the last accepted; it is accepted when the speed that
this needs is one the machine can have. A jump is refused and counted, and the last position stands.
The longer nothing is accepted, the further the machine may have gone: once that is half a turn the
number of turns is not knowable any more and the angle is lost, until `start` begins anew.
"""

import math
from enum import IntEnum
from typing import NamedTuple


class Outcome(IntEnum):
    """What became of a count."""

    ACCEPTED = 0
    JUMPED = 1  # further than the speed allows
    OUT_OF_TURN = 2  # not a count of one turn
    BACK_IN_TIME = 3  # stamped before the last accepted one
    LOST = 4  # turns are not knowable; nothing is accepted any more


class Params(NamedTuple):
    """The encoder and the fastest the machine can turn it."""

    counts_per_turn: int  # 524288 for 19 bits
    max_speed: float  # rad/s, > 0; well above what the machine does, below half a turn a sample
    slack: float  # counts of noise and time stamp error that are no motion, >= 0


class State(NamedTuple):
    """The last accepted count, turns included, and what was refused since the start."""

    known: int  # 0 until the first count
    lost: int
    position: int  # counts, unbounded
    time_us: int  # when it was taken
    jumped: int
    out_of_turn: int
    back_in_time: int


def start() -> State:
    """State before the first count, which fixes the turn: the angle begins within 0 to 2 pi."""
    return State(0, 0, 0, 0, 0, 0, 0)


def step(params: Params, state: State, position: int, time_us: int) -> tuple[State, Outcome]:
    """Take in one count (single turn) and when it was taken (us, any origin)."""
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
    reach = params.slack + params.max_speed * gap_us * 1e-6 * turn / math.tau
    if 2.0 * reach >= turn:
        return state._replace(lost=1), Outcome.LOST
    move = (position - last) % turn
    if 2 * move > turn:
        move -= turn
    if not -reach <= move <= reach:
        return state._replace(jumped=jumped + 1), Outcome.JUMPED
    now = State(known, lost, last + move, time_us, jumped, out_of_turn, back_in_time)
    return now, Outcome.ACCEPTED


def angle(params: Params, state: State) -> float:
    """Angle (rad, positive as the encoder counts) of the last accepted count, turns included."""
    return state.position * (math.tau / params.counts_per_turn)
