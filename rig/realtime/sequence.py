"""Execution of the campaign plan: an immutable table of segments and one pure step through it.

A row of the gain matrix consists of several segments (moving, settle, measure, tail); each lasts a
number of ticks and may also wait for a condition. The table is stored by columns, so the same step
runs over tuples in the loop and over arrays in a compiled batch.
"""

from enum import IntEnum
from typing import NamedTuple


class Phase(IntEnum):
    """Phase of the plan to which a tick belongs; only `MEASURE` ticks enter a row's means."""

    TARE = 0  # calm water, drive off: the sensor zeros are measured
    LEAD_IN = 1  # waves build up before the first row
    MOVING = 2  # a part moves between rows, or the drive is coming on
    SETTLE = 3  # the row's gains act, the transient decays
    MEASURE = 4  # whole wave periods
    TAIL = 5  # rest of the row's interval after its last whole period
    DONE = 6  # plan finished, or left by a stop


# Plain ints for the tick, which compares them a thousand times a second (enum look-up is slower).
TARE, LEAD_IN, MOVING, SETTLE, MEASURE, TAIL, DONE = (int(phase) for phase in Phase)

WAIT_ARRIVAL = 1  # the parts that the plan moves between rows have arrived
WAIT_DRIVE = 2  # the drive has its power stage on

NO_ROW = -1  # row id of segments that belong to no row


class Segments(NamedTuple):
    """The plan, one entry per segment, all columns of equal length; the last segment is `DONE`."""

    row: tuple[int, ...]  # row id, or NO_ROW
    phase: tuple[int, ...]
    ticks: tuple[int, ...]  # length; for a segment that waits for a condition, the minimum length
    wait: tuple[int, ...]  # set of WAIT_ flags that must be met before the segment ends
    timeout: tuple[int, ...]  # ticks after which a segment that still waits has failed
    restart: tuple[int, ...]  # segment to return to after a hold interrupted this one
    drive: tuple[int, ...]  # 1: the drive shall be on
    waves: tuple[int, ...]  # 1: the wave maker shall run
    setpoint: tuple[int, ...]  # index into the kind's table of set points


class State(NamedTuple):
    """Present position in the plan."""

    segment: int
    entered: int  # tick in which the segment began
    attempt: int  # number of times that a hold restarted the row
    paused: int  # 1 while the rig is on hold (the plan does not advance)


class PlanEvents(NamedTuple):
    """Events of the plan in this tick, for the rest of the cycle."""

    finished: bool  # the plan reached its end
    timed_out: bool  # a condition was not met in time


_NO_EVENTS = PlanEvents(False, False)  # one object for most ticks


def start(tick: int) -> State:
    """Return the state that enters the first segment in ``tick``."""
    return State(0, tick, 0, 0)


def step(
    segments: Segments, state: State, tick: int, conditions: int, running: bool, paused: bool
) -> tuple[State, PlanEvents]:
    """Return the plan advanced to ``tick``, and its events.

    ``conditions``: set of the WAIT_ flags that are met now. While ``paused`` the plan does not
    advance, and the interrupted row starts over afterwards; with neither ``running`` nor ``paused``
    the plan is left for good (the last segment, `DONE`).
    """
    last = len(segments.phase) - 1
    if state.segment == last:
        return state, PlanEvents(True, False)
    if not (running or paused):
        return State(last, tick, state.attempt, 0), _NO_EVENTS
    if paused:
        return State(state.segment, state.entered, state.attempt, 1), _NO_EVENTS
    if state.paused == 1:
        state = State(segments.restart[state.segment], tick, state.attempt + 1, 0)
    i = state.segment
    elapsed = tick - state.entered
    if elapsed < segments.ticks[i]:
        return state, _NO_EVENTS
    waiting = (segments.wait[i] & ~conditions) != 0
    if waiting:
        return state, PlanEvents(False, elapsed >= segments.timeout[i])
    # A segment that ends by time ends on its planned tick even if that tick was lost, so that
    # windows do not drift; a segment that waited ends now.
    entered = tick
    if segments.wait[i] == 0:
        entered = state.entered + segments.ticks[i]
    same_row = segments.row[i + 1] == segments.row[i]
    attempt = state.attempt if same_row else 0
    return State(i + 1, entered, attempt, 0), PlanEvents(i + 1 == last, False)
