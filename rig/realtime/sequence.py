"""Walking the campaign plan: an immutable table of segments and one pure step through it.

A row of the gain matrix is several segments (moving, settle, measure, tail); each lasts a number
of ticks and may also wait for a condition. The table is stored by columns, so the same step runs
over tuples in the loop and over arrays in a compiled batch.
"""

from enum import IntEnum
from typing import NamedTuple


class Phase(IntEnum):
    """What a tick belongs to; only `MEASURE` ticks enter a row's means."""

    TARE = 0  # calm water, drive off: sensor zeros are taken
    LEAD_IN = 1  # waves build up before the first row
    MOVING = 2  # stator on its way, or waiting for the drive to come up
    SETTLE = 3  # row's gains in, transient dies out
    MEASURE = 4  # whole wave periods
    TAIL = 5  # rest of the row's interval after its last whole period
    DONE = 6  # plan walked to its end, or left by a stop


# Plain ints for the tick, which compares them a thousand times a second.
TARE, LEAD_IN, MOVING, SETTLE, MEASURE, TAIL, DONE = (int(phase) for phase in Phase)

WAIT_STATOR = 1  # the stator has arrived
WAIT_DRIVE = 2  # the drive has its power stage on

NO_ROW = -1  # row id of segments that belong to no row


class Segments(NamedTuple):
    """The plan, one entry a segment, all columns of one length; the last one is `DONE`."""

    row: tuple[int, ...]  # row id, or NO_ROW
    phase: tuple[int, ...]
    ticks: tuple[int, ...]  # length; with a condition to wait for, the least length
    wait: tuple[int, ...]  # set of WAIT_ flags that must hold before the segment ends
    timeout: tuple[int, ...]  # ticks after which a segment that still waits has failed
    restart: tuple[int, ...]  # segment to go back to when a hold interrupted this one
    drive: tuple[int, ...]  # 1: the drive shall be on
    waves: tuple[int, ...]  # 1: the wave maker shall run
    setpoint: tuple[int, ...]  # index into the kind's table of set points


class State(NamedTuple):
    """Where the plan stands."""

    segment: int
    entered: int  # tick in which the segment began
    attempt: int  # 0, then one more for each time a hold made the row start over
    paused: int  # 1 while the rig is held (the plan stands still)


class Position(NamedTuple):
    """What the walk tells the rest of the cycle in this tick."""

    finished: bool  # the plan's end was reached
    late: bool  # a condition did not come true in time


_ON = Position(False, False)  # made once: most ticks give this


def start(tick: int) -> State:
    """State that enters the first segment in ``tick``."""
    return State(0, tick, 0, 0)


def step(
    segments: Segments, state: State, tick: int, ready: int, running: bool, paused: bool
) -> tuple[State, Position]:
    """Advance the plan to ``tick``.

    ``ready`` is the set of WAIT_ flags that hold now. While ``held`` the plan stands still and the
    interrupted row starts over afterwards; with neither ``running`` nor ``held`` it is left for
    good (the last segment, `DONE`).
    """
    last = len(segments.phase) - 1
    if state.segment == last:
        return state, Position(True, False)
    if not (running or paused):
        return State(last, tick, state.attempt, 0), _ON
    if paused:
        return State(state.segment, state.entered, state.attempt, 1), _ON
    if state.paused == 1:
        state = State(segments.restart[state.segment], tick, state.attempt + 1, 0)
    i = state.segment
    elapsed = tick - state.entered
    if elapsed < segments.ticks[i]:
        return state, _ON
    waiting = (segments.wait[i] & ~ready) != 0
    if waiting:
        return state, Position(False, elapsed >= segments.timeout[i])
    # A segment that ends by time ends on its planned tick even when that tick was lost, so
    # windows do not drift; one that waited ends now.
    entered = tick
    if segments.wait[i] == 0:
        entered = state.entered + segments.ticks[i]
    same_row = segments.row[i + 1] == segments.row[i]
    attempt = state.attempt if same_row else 0
    return State(i + 1, entered, attempt, 0), Position(i + 1 == last, False)
