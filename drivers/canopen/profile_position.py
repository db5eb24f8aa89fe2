"""Moves to a target (CiA 402 mode 1) as a handshake: offer the target, raise the bit, see it taken.

    we    target in 0x607A   bit 4 up ........... bit 4 down
    drive                            bit 12 up ............ bit 12 down   moves   bit 10: reached

Bit 4 new set-point, bit 5 change immediately, bit 8 halt of the controlword; bit 10 target reached,
bit 12 set-point taken, bit 13 following error of the statusword. "Arrived" also asks that the
position is where it was told to be, so that an old "target reached" is not taken for a new one.

A halt ends the move for good: the halt bit is let go only in the very word that offers the next
target, with "change immediately", so that the drive cannot take up the old one again.
"""

from enum import IntEnum
from typing import NamedTuple

from drivers.canopen.cia402_table import HALT
from drivers.canopen.statusword import MODE_BIT_12, MODE_BIT_13, TARGET_REACHED

MODE = 1
NEW = 1 << 4
IMMEDIATELY = 1 << 5


class Phase(IntEnum):
    """Where the move stands."""

    IDLE = 0  # nothing asked for
    OFFERED = 1  # target sent, bit 4 low, the drive is ready for a new set-point
    RAISED = 2  # bit 4 high, not taken yet
    LOWERED = 3  # taken, bit 4 low again, bit 12 still up
    MOVING = 4
    ARRIVED = 5
    FAILED = 6  # halted; `State.failure` says why


class Failure(IntEnum):
    """Why a move failed."""

    NONE = 0
    NOT_ACTING = 1  # the drive was not, or ceased to be, enabled in mode 1
    HALTED = 2  # we stopped it
    FOLLOWING_ERROR = 3  # the drive says that it is too far from where it should be
    LATE_READY = 4  # bit 12 did not fall before the offer
    LATE_TAKEN = 5  # bit 12 did not rise
    LATE_RELEASED = 6  # bit 12 did not fall after it
    LATE_ARRIVAL = 7


_IDLE, _OFFERED, _RAISED, _LOWERED, _MOVING, _ARRIVED, _FAILED = (int(phase) for phase in Phase)
_NONE, _NOT_ACTING, _HALTED, _FOLLOWING, _LATE_READY, _LATE_TAKEN, _LATE_RELEASED, _LATE_ARRIVAL = (
    int(failure) for failure in Failure
)


class Params(NamedTuple):
    """How a move is made."""

    window: int  # counts, >= 0: so near is there
    stand_ticks: int  # for which the drive must say that it is there, >= 1
    immediate: int  # 1: a new target is taken at once, 0: after the old one is reached
    handshake_ticks: int  # deadline of each edge of bit 12
    move_ticks: int  # deadline of the motion


class Inputs(NamedTuple):
    """What came from the wire and what is wanted, this tick."""

    statusword: int
    position: int  # counts, 0x6064
    acting: int  # `cia402.Output.acting`: enabled, fresh, 0x6061 shows mode 1
    request: int  # changes with every move asked for
    target: int  # counts, read when the request changes
    halt: int  # 1: stop where it is; the move is over


class State(NamedTuple):
    """Memory of the handshake."""

    phase: int  # `Phase`
    failure: int  # `Failure`
    request: int  # the last one seen
    target: int  # counts
    halted: int  # 1: the halt bit stands until the next target is offered
    stood: int  # ticks for which the drive has said that it is there
    ticks: int  # in this phase


class Output(NamedTuple):
    """What to send."""

    mode_bits: int  # of the controlword
    target: int  # counts, for 0x607A: the present position until a target was given


def start(request: int) -> State:
    """Nothing asked for; requests that were counted before mean nothing."""
    return State(_IDLE, _NONE, request, 0, 0, 0, 0)


def _next(params: Params, state: State, inputs: Inputs) -> tuple[int, int, int]:
    """Phase, failure and ticks stood there, of a move that nothing stops."""
    phase, _, _, target, _, stood, ticks = state
    taken = inputs.statusword & MODE_BIT_12
    late = ticks > params.handshake_ticks
    if phase == _OFFERED and ticks > 1 and not taken:
        return _RAISED, _NONE, 0
    if phase == _OFFERED:
        return (_FAILED, _LATE_READY, 0) if late else (_OFFERED, _NONE, 0)
    if phase == _RAISED and not taken:
        return (_FAILED, _LATE_TAKEN, 0) if late else (_RAISED, _NONE, 0)
    if phase == _RAISED:
        return _LOWERED, _NONE, 0
    if phase == _LOWERED and taken:
        return (_FAILED, _LATE_RELEASED, 0) if late else (_LOWERED, _NONE, 0)
    if inputs.statusword & MODE_BIT_13:
        return _FAILED, _FOLLOWING, 0
    near = -params.window <= inputs.position - target <= params.window
    stood = stood + 1 if near and inputs.statusword & TARGET_REACHED else 0
    if stood >= params.stand_ticks:
        return _ARRIVED, _NONE, stood
    if phase == _MOVING and ticks > params.move_ticks:
        return _FAILED, _LATE_ARRIVAL, 0
    return _MOVING, _NONE, stood


def step(params: Params, state: State, inputs: Inputs) -> tuple[State, Output]:
    """One tick; raises nothing."""
    phase, failure, _, target, halted, stood, ticks = state
    ticks += 1
    if inputs.request != state.request:
        phase, failure, target, stood, ticks = _OFFERED, _NONE, inputs.target, 0, 1
    if _OFFERED <= phase <= _ARRIVED:
        if inputs.halt == 1 or inputs.acting == 0:
            phase, failure = _FAILED, _HALTED if inputs.halt == 1 else _NOT_ACTING
        else:
            was = State(phase, failure, inputs.request, target, halted, stood, ticks)
            after, failure, stood = _next(params, was, inputs)
            phase, ticks = after, ticks if after == phase else 1

    bits = 0
    if phase == _RAISED:
        bits = NEW | IMMEDIATELY if params.immediate == 1 or halted == 1 else NEW
    elif inputs.halt == 1 or phase == _FAILED or (phase in (_IDLE, _OFFERED) and halted == 1):
        bits = HALT
    # Once the target that was offered in its place is taken, the halt is over.
    if phase == _LOWERED:
        halted = 0
    elif bits == HALT:
        halted = 1
    after_state = State(phase, failure, inputs.request, target, halted, stood, ticks)
    given = target if phase != _IDLE else inputs.position
    return after_state, Output(bits, given)
