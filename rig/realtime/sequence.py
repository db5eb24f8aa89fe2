"""Execution of the campaign plan: an immutable table of segments and one pure step through it.

A row of the gain matrix consists of several segments (moving, settle, measure, tail); each lasts a
number of ticks and may also wait for a condition. The table is stored by columns, so the same step
runs over tuples in the loop and over arrays in a compiled batch.
"""

from enum import IntEnum
from typing import NamedTuple

from rig.realtime.requests import NO_REQUEST, Request


class Phase(IntEnum):
    """Phase of the plan to which a tick belongs; only `MEASURE` ticks enter a row's means."""

    TARE = 0  # calm water, drive off: the sensor zeros are measured
    LEAD_IN = 1  # waves build up before the first row
    MOVING = 2  # a part moves between rows, or the drive is coming on
    SETTLE = 3  # the row's gains act, the transient decays
    MEASURE = 4  # whole wave periods
    TAIL = 5  # rest of the row's interval after its last whole period
    DONE = 6  # plan finished, or left by a stop
    STANDBY = 7  # drive off, until people have armed the run
    MANUAL = 8  # people choose the set point
    CHOICE = 9  # the next row is being chosen; the set point of the last one stays in force


# Plain ints for the tick, which compares them a thousand times a second (enum look-up is slower).
TARE, LEAD_IN, MOVING, SETTLE, MEASURE, TAIL, DONE, STANDBY, MANUAL, CHOICE = (
    int(phase) for phase in Phase
)

WAIT_ARRIVAL = 1  # the parts that the plan moves between rows have arrived
WAIT_DRIVE = 2  # the drive has its power stage on
WAIT_ARMED = 4  # people have armed the run
WAIT_ORDER = 8  # never met: an order leads out of the segment
WAIT_SETTLED = 16  # transients have decayed (`rig.realtime.assessment`)
WAIT_KNOWN = 32  # the mean power of the row is known well enough
ASSESSED = WAIT_SETTLED | WAIT_KNOWN  # conditions that have until the timeout, and then are left

NO_ROW = -1  # row id of segments that belong to no row


class Segments(NamedTuple):
    """The plan, one entry per segment, all columns of equal length; the last segment is `DONE`."""

    row: tuple[int, ...]  # row id, or NO_ROW
    phase: tuple[int, ...]
    ticks: tuple[int, ...]  # length; for a segment that waits for a condition, the minimum length
    wait: tuple[int, ...]  # set of WAIT_ flags that must be met before the segment ends
    timeout: tuple[int, ...]  # ticks after which a segment that waits has failed, or is over
    restart: tuple[int, ...]  # segment to return to after a hold interrupted this one
    drive: tuple[int, ...]  # 1: the drive shall be on
    waves: tuple[int, ...]  # 1: the wave maker shall run
    setpoint: tuple[int, ...]  # index into the kind's table of set points


class State(NamedTuple):
    """Present position in the plan."""

    segment: int
    entered: int  # tick in which the segment began
    attempt: int  # number of times that the row was started over
    paused: int  # 1 while the plan does not advance: on hold, or manual mode within a campaign
    live: int = 0  # number of the set point in force that people chose; 0: the plan's own
    jump: int = 0  # number of the last order that was carried out


class PlanEvents(NamedTuple):
    """Events of the plan in this tick, for the rest of the cycle."""

    finished: bool  # the plan reached its end
    timed_out: bool  # a condition was not met in time


_NO_EVENTS = PlanEvents(False, False)  # one object for most ticks


def start(tick: int) -> State:
    """Return the state that enters the first segment in ``tick``."""
    return State(0, tick, 0, 0)


def step(
    segments: Segments,
    state: State,
    tick: int,
    conditions: int,
    running: bool,
    paused: bool,
    request: Request = NO_REQUEST,
) -> tuple[State, PlanEvents]:
    """Return the plan advanced to ``tick``, and its events.

    ``conditions``: set of the WAIT_ flags that are met now. While ``paused`` the plan does not
    advance, and the interrupted row starts over afterwards; with neither ``running`` nor ``paused``
    the plan is left for good (the last segment, `DONE`).

    A set point that people choose is in force in a segment of the phase `MANUAL`, and within a
    campaign from a hold to the next hold: only a hold leads from row to manual mode and back.
    """
    last = len(segments.phase) - 1
    i, entered, attempt, was_paused, live, jump = state
    if i == last:
        return state, PlanEvents(True, False)
    if not (running or paused):
        return State(last, tick, attempt, 0, 0, jump), _NO_EVENTS
    manual = segments.phase[i] == MANUAL
    if request.jump != jump and 0 <= request.segment <= last:
        if request.segment == last:
            return State(last, tick, attempt, 0, 0, request.jump), PlanEvents(True, False)
        live = 0 if manual else live
        # Back to this row or to one before it: another attempt, unless rows have no order.
        is_attempt = request.segment <= i and segments.phase[i] != CHOICE
        attempt = attempt + 1 if is_attempt else 0
        i, entered, jump = request.segment, tick, request.jump
        state = State(i, entered, attempt, was_paused, live, jump)
        manual = segments.phase[i] == MANUAL
    if manual or paused or (live != 0 and request.live != 0):
        live = request.live
    if paused or (live != 0 and not manual):
        return State(i, entered, attempt, 1, live, jump), _NO_EVENTS
    if was_paused == 1:
        i, entered, attempt = segments.restart[i], tick, attempt + 1
        state = State(i, entered, attempt, 0, live, jump)
    elif live != state.live:
        state = State(i, entered, attempt, 0, live, jump)
    elapsed = tick - entered
    if elapsed < segments.ticks[i]:
        return state, _NO_EVENTS
    waiting = (segments.wait[i] & ~conditions) != 0
    if waiting:
        late = elapsed >= segments.timeout[i]
        if not late or (segments.wait[i] & ASSESSED) == 0:
            return state, PlanEvents(False, late)
    # A segment that ends by time ends on its planned tick even if that tick was lost, so that
    # windows do not drift; a segment that waited ends now.
    next_entered = tick
    if segments.wait[i] == 0:
        next_entered = entered + segments.ticks[i]
    same_row = segments.row[i + 1] == segments.row[i]
    attempt = attempt if same_row else 0
    return State(i + 1, next_entered, attempt, 0, 0, jump), PlanEvents(i + 1 == last, False)
