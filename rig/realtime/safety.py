"""The safety machine: one table that a person can read at once.

Stop categories follow IEC 60204-1: category 0 removes power at once; category 1 brings the motion
to rest (passive damping), then removes power; category 2 does the same and keeps power on.
The machine never leaves a stop of category 0 or 1: a new run needs a new, explicit request.
"""

from enum import IntEnum
from typing import NamedTuple

from controllers.signals import Index, Tick
from rig.realtime.reasons import NO_REASON, Reason, reason_table


class Mode(IntEnum):
    """State of the machine."""

    OFF = 0  # power off, no fault
    ENABLING = 1  # power requested, the drive is not on yet
    RUN = 2  # the law acts
    STOP_2 = 3  # on hold: damping, power stays on
    STOP_1 = 4  # damping for a set time, then STOP_0
    STOP_0 = 5  # power off, latched


# Plain ints for the tick: an enum look-up costs 0.1 us, and a tick does many comparisons.
OFF, ENABLING, RUN, STOP_2, STOP_1, STOP_0 = (int(mode) for mode in Mode)


class Event(IntEnum):
    """Events of a tick, the most important first: of several only the first counts."""

    TRIP_0 = 0  # a fault that allows no controlled stop
    EXPIRED = 1  # the present mode has reached its time limit
    TRIP_1 = 2  # a fault that allows a controlled stop
    STOP = 3  # the operator, the supervisor, or the plan's end
    HOLD = 4  # the operator requests a hold
    RESUME = 5
    POWERED = 6  # the plan requires the drive on, and the drive reports on
    POWER_REQUIRED = 7  # the plan requires the drive on, and the drive is not on yet
    NONE = 8


_OFF, _ENA, _RUN = Mode.OFF, Mode.ENABLING, Mode.RUN
_ST2, _ST1, _ST0 = Mode.STOP_2, Mode.STOP_1, Mode.STOP_0

# fmt: off
TABLE: tuple[tuple[Mode, ...], ...] = (
    # TRIP_0 EXPIRED TRIP_1 STOP  HOLD  RESUME POWERED POWER_REQUIRED NONE
    (_ST0,   _OFF,   _ST0,  _ST0, _OFF, _OFF,  _ENA,   _ENA,          _OFF),  # OFF
    (_ST0,   _ST0,   _ST0,  _ST0, _ENA, _ENA,  _RUN,   _ENA,          _ENA),  # ENABLING
    (_ST0,   _RUN,   _ST1,  _ST1, _ST2, _RUN,  _RUN,   _RUN,          _RUN),  # RUN
    (_ST0,   _ST2,   _ST1,  _ST1, _ST2, _RUN,  _ST2,   _ST2,          _ST2),  # STOP_2
    (_ST0,   _ST0,   _ST1,  _ST1, _ST1, _ST1,  _ST1,   _ST1,          _ST1),  # STOP_1
    (_ST0,   _ST0,   _ST0,  _ST0, _ST0, _ST0,  _ST0,   _ST0,          _ST0),  # STOP_0
)
# fmt: on

_NEXT = tuple(tuple(int(mode) for mode in row) for row in TABLE)
_TRIP_0, _EXPIRED, _TRIP_1, _STOP, _HOLD, _RESUME, _POWERED, _POWER_REQUIRED, _NONE = (
    int(event) for event in Event
)


CATEGORY = reason_table().categories
"""The stop category of the core's reasons, by number."""

# Requests of the operator and of the supervisor, from the mailbox.
REQUEST_NONE = 0
REQUEST_STOP = 1
REQUEST_ABORT = 2
REQUEST_HOLD = 3
REQUEST_RESUME = 4
REQUEST_LOGGER_LOST = 5
REQUEST_SUPERVISOR_LOST = 6
REQUEST_NO_OPERATOR = 7


class Params(NamedTuple):
    """Time limits of the modes, in ticks."""

    enable_ticks: int  # ENABLING
    stop_ticks: int  # STOP_1


class State(NamedTuple):
    """State of the machine; logged every tick."""

    mode: Index  # `Mode`
    entered: Tick  # tick in which the mode began
    reason: Index  # `rig.realtime.reasons`: first cause of the stop


def start(tick: int) -> State:
    """Return the state at switch-on: power off, no fault."""
    return State(0, tick, 0)


def stop_reason(request: int) -> int:
    """Return the stop reason that a request carries, or NONE."""
    if request == REQUEST_STOP:
        return Reason.OPERATOR_STOP.value
    if request == REQUEST_ABORT:
        return Reason.OPERATOR_ABORT.value
    if request == REQUEST_LOGGER_LOST:
        return Reason.LOGGER_LOST.value
    if request == REQUEST_SUPERVISOR_LOST:
        return Reason.SUPERVISOR_LOST.value
    if request == REQUEST_NO_OPERATOR:
        return Reason.NO_OPERATOR.value
    return Reason.NONE.value


def step(
    params: Params,
    state: State,
    tick: int,
    trip: int,
    request: int,
    plan_finished: bool,
    power_required: bool,
    drive_on: bool,
    category: tuple[int, ...] = CATEGORY,
) -> State:
    """Return the mode of this tick.

    ``trip``: reason (0: none) found by this tick's checks; ``plan_finished``: the plan has reached
    its end; ``power_required``: the plan requires the drive on; ``drive_on``: the drive reports
    that it is; ``category``: the stop category by number of reason, those of the kind included.
    """
    mode = state.mode
    age = tick - state.entered
    reason = trip
    if reason == NO_REASON and mode == ENABLING and age >= params.enable_ticks and not drive_on:
        reason = Reason.DRIVE_NOT_ON.value
    if request != REQUEST_NONE:
        request_reason = stop_reason(request)
        # An abort has priority over a fault that would still allow a controlled stop.
        if request_reason != NO_REASON and (
            reason == NO_REASON or category[request_reason] < category[reason]
        ):
            reason = request_reason
    if reason == NO_REASON and plan_finished:
        reason = Reason.PLAN_END.value

    if reason != NO_REASON and category[reason] == 0:
        event = _TRIP_0
    elif mode == STOP_1 and age >= params.stop_ticks:
        event = _EXPIRED
    elif trip != NO_REASON:
        event = _TRIP_1
    elif reason != NO_REASON:
        event = _STOP
    elif request == REQUEST_HOLD and mode == RUN:
        event = _HOLD
    elif request == REQUEST_RESUME and mode == STOP_2:
        event = _RESUME
    elif power_required:
        event = _POWERED if drive_on else _POWER_REQUIRED
    else:
        event = _NONE

    after = _NEXT[mode][event]
    if after == mode:
        return state
    # The first reason is the cause; later ones are often its consequences and must not replace it.
    first_reason = state.reason if state.reason != NO_REASON else reason
    return State(after, tick, first_reason)
