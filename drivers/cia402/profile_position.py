"""Handshake of a move to a target (CiA 402 mode 1): send target, raise bit, await acknowledge.

    host  target in 0x607A   bit 4 up ........... bit 4 down
    drive                            bit 12 up ............ bit 12 down   moves   bit 10: reached

Bit 4 new set-point, bit 5 change immediately, bit 8 halt of the controlword; bit 10 target reached,
bit 12 set-point acknowledge, bit 13 following error of the statusword. "Arrived" also requires the
position to be at the target, so that an old "target reached" is not taken for a new one.

A halt ends the move for good: the halt bit is cleared only in the controlword that offers the next
target, with "change immediately", so that the drive cannot resume the old one.
"""

from enum import IntEnum
from typing import NamedTuple

from drivers.cia402.state_table import HALT
from drivers.cia402.statusword import MODE_BIT_12, MODE_BIT_13, TARGET_REACHED

MODE = 1
NEW_SET_POINT = 1 << 4
CHANGE_IMMEDIATELY = 1 << 5


class Phase(IntEnum):
    """Phase of the move."""

    IDLE = 0  # no request
    OFFERED = 1  # target sent, bit 4 low, the drive is ready for a new set-point
    RAISED = 2  # bit 4 high, not acknowledged yet
    LOWERED = 3  # acknowledged, bit 4 low again, bit 12 still high
    MOVING = 4
    ARRIVED = 5
    FAILED = 6  # halted; see `State.failure`


class Failure(IntEnum):
    """The reason why a move failed."""

    NONE = 0
    NOT_ACTING = 1  # the drive was not, or ceased to be, enabled in mode 1
    HALTED = 2  # halted by the host
    FOLLOWING_ERROR = 3  # reported by the drive: too far from its demand position
    LATE_READY = 4  # bit 12 did not fall before the offer
    LATE_TAKEN = 5  # bit 12 did not rise
    LATE_RELEASED = 6  # bit 12 did not fall after it
    LATE_ARRIVAL = 7


_IDLE, _OFFERED, _RAISED, _LOWERED, _MOVING, _ARRIVED, _FAILED = (int(phase) for phase in Phase)
_NONE, _NOT_ACTING, _HALTED, _FOLLOWING, _LATE_READY, _LATE_TAKEN, _LATE_RELEASED, _LATE_ARRIVAL = (
    int(failure) for failure in Failure
)


class Params(NamedTuple):
    """Parameters of a move."""

    window: int  # counts, >= 0: largest distance from the target on arrival
    settle_ticks: int  # ticks of "target reached" that count as arrival, >= 1
    immediate: int  # 1: a new target replaces the old one at once, 0: after its arrival
    handshake_ticks: int  # deadline of each edge of bit 12
    move_ticks: int  # deadline of the motion


class Inputs(NamedTuple):
    """Received values and requests of this tick."""

    statusword: int
    position: int  # counts, 0x6064
    acting: int  # `cia402.Output.acting`: enabled, fresh, 0x6061 displays mode 1
    request: int  # changes with every request for a move
    target: int  # counts, read when the request changes
    halt: int  # 1: stop at the present position; ends the move


class State(NamedTuple):
    """State of the handshake."""

    phase: int  # `Phase`
    failure: int  # `Failure`
    request: int  # the last one seen
    target: int  # counts
    halted: int  # 1: the halt bit stays set until the next target is offered
    settled_ticks: int  # ticks at the target with "target reached"
    ticks: int  # in this phase


class Output(NamedTuple):
    """Values to send."""

    mode_bits: int  # of the controlword
    target: int  # counts, for 0x607A: the present position before the first target


def start(request: int) -> State:
    """Return the idle state; ``request``: number that has already been used."""
    return State(_IDLE, _NONE, request, 0, 0, 0, 0)


def _advance(params: Params, state: State, inputs: Inputs) -> tuple[int, int, int]:
    """Return phase, failure and settled ticks of a move that is not stopped."""
    phase, _, _, target, _, settled_ticks, ticks = state
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
    settled_ticks = settled_ticks + 1 if near and inputs.statusword & TARGET_REACHED else 0
    if settled_ticks >= params.settle_ticks:
        return _ARRIVED, _NONE, settled_ticks
    if phase == _MOVING and ticks > params.move_ticks:
        return _FAILED, _LATE_ARRIVAL, 0
    return _MOVING, _NONE, settled_ticks


def step(params: Params, state: State, inputs: Inputs) -> tuple[State, Output]:
    """Return state and output after one tick; raises nothing."""
    phase, failure, _, target, halted, settled_ticks, ticks = state
    ticks += 1
    if inputs.request != state.request:
        phase, failure, target, settled_ticks, ticks = _OFFERED, _NONE, inputs.target, 0, 1
    if _OFFERED <= phase <= _ARRIVED:
        if inputs.halt == 1 or inputs.acting == 0:
            phase, failure = _FAILED, _HALTED if inputs.halt == 1 else _NOT_ACTING
        else:
            previous = State(phase, failure, inputs.request, target, halted, settled_ticks, ticks)
            next_phase, failure, settled_ticks = _advance(params, previous, inputs)
            phase, ticks = next_phase, ticks if next_phase == phase else 1

    bits = 0
    if phase == _RAISED:
        bits = (
            NEW_SET_POINT | CHANGE_IMMEDIATELY
            if params.immediate == 1 or halted == 1
            else NEW_SET_POINT
        )
    elif inputs.halt == 1 or phase == _FAILED or (phase in (_IDLE, _OFFERED) and halted == 1):
        bits = HALT
    # The halt ends once the drive has acknowledged the next target.
    if phase == _LOWERED:
        halted = 0
    elif bits == HALT:
        halted = 1
    next_state = State(phase, failure, inputs.request, target, halted, settled_ticks, ticks)
    sent_target = target if phase != _IDLE else inputs.position
    return next_state, Output(bits, sent_target)
