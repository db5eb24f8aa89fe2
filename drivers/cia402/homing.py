"""Handshake of homing (CiA 402 mode 6): raise the start bit, monitor the outcome, report failures.

The drive homes while bit 4 of the controlword is set; its outcome is in statusword bits 10, 12 and
13. An outcome left from an earlier homing does not count: it must change first.
"""

from enum import IntEnum
from typing import NamedTuple

from drivers.cia402.state_table import HALT

MODE = 6
START = 1 << 4
MASK = 0x3400


class Outcome(IntEnum):
    """Outcome of homing in the statusword of mode 6."""

    IN_PROGRESS = 0
    INTERRUPTED = 1  # or not started
    ATTAINED = 2  # still moving
    HOMED = 3
    ERROR_MOVING = 4
    ERROR = 5
    CONTRADICTORY = 6  # homed and error bits both set


OUTCOMES = {  # statusword & MASK
    0x0000: Outcome.IN_PROGRESS,
    0x0400: Outcome.INTERRUPTED,
    0x1000: Outcome.ATTAINED,
    0x1400: Outcome.HOMED,
    0x2000: Outcome.ERROR_MOVING,
    0x2400: Outcome.ERROR,
    0x3000: Outcome.CONTRADICTORY,
    0x3400: Outcome.CONTRADICTORY,
}

_OUTCOMES = {bits: int(outcome) for bits, outcome in OUTCOMES.items()}
_IN_PROGRESS, _INTERRUPTED, _ATTAINED, _DRIVE_HOMED, *_ = (int(o) for o in Outcome)


class Phase(IntEnum):
    """Phase of the homing."""

    IDLE = 0  # no request
    LOWERED = 1  # start bit low for a tick, so that an edge follows
    RAISED = 2  # start bit high, the drive has not answered yet
    MOVING = 3
    HOMED = 4
    FAILED = 5  # halted; see `State.failure`


class Failure(IntEnum):
    """The reason why a homing failed."""

    NONE = 0
    NOT_ACTING = 1  # the drive was not, or ceased to be, enabled in mode 6
    HALTED = 2  # halted by the host
    DRIVE_ERROR = 3  # reported by the drive
    INTERRUPTED = 4  # the drive stopped on the way without an error
    LATE_START = 5  # no answer to the start bit
    LATE_END = 6


_IDLE, _LOWERED, _RAISED, _MOVING, _HOMED, _FAILED = (int(phase) for phase in Phase)
_NONE, _NOT_ACTING, _HALTED, _ERROR, _STOPPED, _LATE_START, _LATE_END = (int(f) for f in Failure)


class Params(NamedTuple):
    """Deadlines, in ticks."""

    start_ticks: int  # from the edge to the drive's answer
    end_ticks: int  # of the motion


class Inputs(NamedTuple):
    """Received values and requests of this tick."""

    statusword: int
    acting: int  # `cia402.Output.acting`: enabled, fresh, 0x6061 displays mode 6
    request: int  # changes with every request
    halt: int  # 1: stop at the present position


class State(NamedTuple):
    """State of the handshake."""

    phase: int  # `Phase`
    failure: int  # `Failure`
    request: int  # the last one seen
    outcome_before: int  # `Outcome` before the edge
    ticks: int  # in this phase


def start(request: int) -> State:
    """Return the idle state; ``request``: number that has already been used."""
    return State(_IDLE, _NONE, request, _INTERRUPTED, 0)


def outcome(statusword: int) -> int:
    """Return the `Outcome` of any statusword in mode 6."""
    return _OUTCOMES[statusword & MASK]


def _result(params: Params, state: State, now: int, ticks: int) -> tuple[int, int]:
    """Return phase and failure for the drive's present outcome while the start bit is set."""
    raised = state.phase == _RAISED
    moves = now in (_IN_PROGRESS, _ATTAINED)
    if raised and not moves and now in (state.outcome_before, _INTERRUPTED):
        late = ticks > params.start_ticks
        return (_FAILED, _LATE_START) if late else (_RAISED, _NONE)
    if now == _DRIVE_HOMED:
        return _HOMED, _NONE
    if now == _INTERRUPTED:
        return _FAILED, _STOPPED
    if not moves:
        return _FAILED, _ERROR
    if not raised and ticks > params.end_ticks:
        return _FAILED, _LATE_END
    return _MOVING, _NONE


def step(params: Params, state: State, inputs: Inputs) -> tuple[State, int]:
    """Return the state after one tick and the mode bits for the controlword."""
    phase, failure, _, before, ticks = state
    now = outcome(inputs.statusword)
    ticks += 1
    if inputs.request != state.request:
        phase, failure, before, ticks = _LOWERED, _NONE, now, 1
    if _LOWERED <= phase <= _MOVING and (inputs.halt == 1 or inputs.acting == 0):
        phase, failure = _FAILED, _HALTED if inputs.halt == 1 else _NOT_ACTING
    elif phase == _LOWERED:
        if ticks > 1:
            phase, before, ticks = _RAISED, now, 1
    elif phase in (_RAISED, _MOVING):
        previous = State(phase, failure, inputs.request, before, ticks)
        next_phase, failure = _result(params, previous, now, ticks)
        before = now if phase == _RAISED else before
        phase, ticks = next_phase, ticks if next_phase == phase else 1
    bits = START if phase in (_RAISED, _MOVING) else 0
    if phase == _FAILED or inputs.halt == 1:
        bits = HALT
    return State(phase, failure, inputs.request, before, ticks), bits
