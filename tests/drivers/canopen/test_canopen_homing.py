"""Homing: outcomes, the edge, an old outcome that is ignored, and failures."""

from __future__ import annotations

from typing import Any

import pytest
from canopen.profiles.p402 import Homing
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402 import homing
from drivers.cia402.homing import Failure, Inputs, Outcome, Params, Phase, State
from drivers.cia402.state_table import HALT

PARAMS = Params(start_ticks=4, end_ticks=10)
NOT_STARTED, MOVING, ATTAINED, HOMED = 0x0637, 0x0237, 0x1237, 0x1637
QUIET = Inputs(NOT_STARTED, acting=1, request=0, halt=0)


def run(words: list[int], state: State | None = None, **inputs: Any) -> tuple[State, list[int]]:
    state = state or homing.start(0)
    bits = []
    for word in words:
        state, sent = homing.step(PARAMS, state, QUIET._replace(statusword=word, **inputs))
        bits.append(sent)
    return state, bits


def test_every_statusword_has_one_outcome_as_an_independent_table_says() -> None:
    names = {
        "IN PROGRESS": Outcome.IN_PROGRESS, "INTERRUPTED": Outcome.INTERRUPTED,
        "ATTAINED": Outcome.ATTAINED, "TARGET REACHED": Outcome.HOMED,
        "ERROR VELOCITY IS NOT ZERO": Outcome.ERROR_MOVING, "ERROR VELOCITY IS ZERO": Outcome.ERROR,
    }  # fmt: skip
    assert set(names) == set(Homing.STATES)
    for word in range(0x10000):
        peer = [name for name, (mask, bits) in Homing.STATES.items() if word & mask == bits]
        assert homing.outcome(word) == (names[peer[0]] if peer else Outcome.CONTRADICTORY)


def test_no_motion_before_a_request() -> None:
    state, bits = run([NOT_STARTED, MOVING, HOMED, 0xFFFF] * 5)
    assert set(bits) == {0}
    assert state.phase == Phase.IDLE


def test_a_homing_from_edge_to_end() -> None:
    words = [NOT_STARTED] * 4 + [MOVING] * 3 + [ATTAINED] * 2 + [HOMED] * 3
    state, bits = run(words, request=1)
    assert bits == [0x00] + [0x10] * 8 + [0x00] * 3
    assert (state.phase, state.failure) == (Phase.HOMED, Failure.NONE)


@pytest.mark.parametrize("between", [MOVING, ATTAINED, NOT_STARTED])
def test_an_old_outcome_is_ignored(between: int) -> None:
    state, bits = run([HOMED] * 4, request=1)
    assert (state.phase, bits) == (Phase.RAISED, [0, 0x10, 0x10, 0x10])
    done, _ = run([between, HOMED], state, request=1)
    assert done.phase == Phase.HOMED
    failed, _ = run([HOMED] * 3, state, request=1)
    assert (failed.phase, failed.failure) == (Phase.FAILED, Failure.LATE_START)
    assert run([0x2637] * 8, request=1)[0].failure == Failure.LATE_START


@pytest.mark.parametrize(
    ("words", "inputs", "failure"),
    [
        ([NOT_STARTED] * 8, {}, Failure.LATE_START),
        ([NOT_STARTED] * 2 + [MOVING] * 12, {}, Failure.LATE_END),
        ([NOT_STARTED] * 2 + [MOVING, NOT_STARTED], {}, Failure.INTERRUPTED),
        ([NOT_STARTED] * 2 + [MOVING, 0x2237], {}, Failure.DRIVE_ERROR),
        ([NOT_STARTED] * 2 + [0x2637], {}, Failure.DRIVE_ERROR),
        ([NOT_STARTED] * 2 + [0x3637], {}, Failure.DRIVE_ERROR),
        ([NOT_STARTED], {"acting": 0}, Failure.NOT_ACTING),
        ([NOT_STARTED], {"halt": 1}, Failure.HALTED),
    ],
)
def test_failures_are_named_and_halt(words: list[int], inputs: Any, failure: Failure) -> None:
    state, bits = run(words, request=1, **inputs)
    assert (state.phase, state.failure, bits[-1]) == (Phase.FAILED, failure, HALT)
    state, bits = run([HOMED] * 9, state, request=1)
    assert set(bits) == {HALT}  # until a new request
    state, bits = run([HOMED] + [NOT_STARTED] * 2 + [HOMED], state, request=2)
    assert state.phase == Phase.HOMED


def test_losing_the_drive_on_the_way_fails() -> None:
    state, _ = run([NOT_STARTED] * 2 + [MOVING] * 2, request=1)
    assert run([MOVING], state, request=1, acting=0)[0].failure == Failure.NOT_ACTING
    assert run([MOVING], state, request=1, halt=1)[0].failure == Failure.HALTED
    # Once homed, a disabled drive has still been homed.
    state, _ = run([HOMED], state, request=1)
    assert run([MOVING], state, request=1, acting=0)[0].phase == Phase.HOMED


def test_the_motion_may_last_to_its_last_tick_and_a_halt_shows_in_idle() -> None:
    state = State(Phase.MOVING, 0, 1, Outcome.INTERRUPTED, 1)
    for tick in range(2, PARAMS.end_ticks + 2):
        (state, _) = run([MOVING], state, request=1)
        assert (state.phase == Phase.FAILED) == (tick > PARAMS.end_ticks)
    assert run([NOT_STARTED], halt=1)[1] == [HALT]


words = st.integers(0, 0xFFFF)


@given(st.lists(st.tuples(words, st.integers(0, 1), st.integers(0, 3), st.integers(0, 1))))
def test_the_start_bit_stands_only_while_the_drive_acts(ticks: list[tuple[int, ...]]) -> None:
    state, last = homing.start(0), 0
    for word, acting, request, halt in ticks:
        state, bits = homing.step(PARAMS, state, Inputs(word, acting, request, halt))
        assert bits in (0, homing.START, HALT)
        if bits == homing.START:
            assert (acting, halt) == (1, 0)
        if halt:
            assert bits == HALT
        if bits == homing.START != last:
            assert last in (0, HALT)
        last = bits
