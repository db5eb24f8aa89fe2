"""Moves: the handshake with a drive, persistent halts, and failures."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402 import profile_position as pp
from drivers.cia402.profile_position import Failure, Inputs, Params, Phase
from drivers.cia402.state_table import HALT

PARAMS = Params(window=10, settle_ticks=3, immediate=1, handshake_ticks=5, move_ticks=60)


class Actuator:
    """Accepts a target on the edge of bit 4, moves 100 counts per tick, answers a tick late."""

    def __init__(self, position: int = 0) -> None:
        self.position = self.goal = position
        self.last = 0
        self.word = 0x0637
        self.deaf = False
        self.blocked = False
        self.following = False
        self.taken = 0

    def tick(self, bits: int, target: int) -> None:
        if not self.deaf:
            if bits & ~self.last & 0x10:
                self.goal, self.taken = target, self.taken + 1
            self.last = bits
        if not (self.blocked or bits & HALT):
            self.position += max(-100, min(100, self.goal - self.position))
        reached = self.position == self.goal or bool(bits & HALT)
        self.word = 0x0237 | reached << 10 | bool(self.last & 0x10) << 12 | self.following << 13


class Bench:
    def __init__(self, params: Params = PARAMS, position: int = 0) -> None:
        self.params = params
        self.drive = Actuator(position)
        self.state = pp.start(0)
        self.out = pp.Output(0, 0)
        self.inputs = Inputs(0, 0, acting=1, request=0, target=0, halt=0)
        self.bits: list[int] = []

    def run(self, ticks: int, **inputs: Any) -> Bench:
        self.inputs = self.inputs._replace(**inputs)
        for _ in range(ticks):
            now = self.inputs._replace(statusword=self.drive.word, position=self.drive.position)
            self.drive.tick(*self.out)
            self.state, self.out = pp.step(self.params, self.state, now)
            self.bits.append(self.out.mode_bits)
        return self

    @property
    def phase(self) -> Phase:
        return Phase(self.state.phase)


def test_no_motion_before_a_request() -> None:
    bench = Bench(position=4000).run(20)
    assert set(bench.bits) == {0}
    assert (bench.drive.position, bench.out.target) == (4000, 4000)


def test_a_move() -> None:
    bench = Bench().run(40, request=1, target=1500)
    assert (bench.phase, bench.drive.position, bench.drive.taken) == (Phase.ARRIVED, 1500, 1)
    assert bench.bits[0] == 0  # the target is there before the edge
    assert set(bench.bits) == {0, 0x30}


def test_without_immediate_the_bit_stays_low() -> None:
    assert 0x10 in Bench(PARAMS._replace(immediate=0)).run(40, request=1, target=500).bits


def test_a_new_target_on_the_way() -> None:
    bench = Bench().run(10, request=1, target=5000).run(30, request=2, target=-300)
    assert (bench.phase, bench.drive.position, bench.drive.taken) == (Phase.ARRIVED, -300, 2)


def test_target_reached_counts_only_at_the_target() -> None:
    bench = Bench()
    bench.drive.blocked = True
    bench.run(8, request=1, target=1500)
    bench.drive.goal = 0  # reports the target as reached, which is wrong
    bench.run(30)
    assert bench.phase == Phase.MOVING
    assert bench.run(40).state.failure == Failure.LATE_ARRIVAL


def test_a_drive_that_leaves_its_target_is_not_there_any_more() -> None:
    bench = Bench().run(40, request=1, target=1500)
    bench.drive.position = 1400
    bench.drive.blocked = True
    assert bench.run(2).phase == Phase.MOVING
    bench.drive.blocked = False
    assert bench.run(8).phase == Phase.ARRIVED


def test_a_halt_ends_the_move_for_good() -> None:
    bench = Bench().run(10, request=1, target=5000).run(3, halt=1)
    assert (bench.phase, bench.state.failure) == (Phase.FAILED, Failure.HALTED)
    stopped = bench.drive.position
    assert 0 < stopped < 5000
    bench.run(50, halt=0)
    assert (bench.drive.position, bench.out.mode_bits) == (stopped, HALT)
    bench.bits.clear()
    bench.run(30, request=2, target=stopped - 200)
    assert bench.bits[0] == HALT  # let go only with the word that offers the next target
    assert bench.bits[1] in (HALT, 0x30)
    assert bench.phase == Phase.ARRIVED


def test_a_halt_without_immediate_still_replaces_the_old_target() -> None:
    bench = Bench(PARAMS._replace(immediate=0)).run(10, request=1, target=5000).run(3, halt=1)
    bench.bits.clear()
    bench.run(20, halt=0, request=2, target=0)
    assert 0x30 in bench.bits
    assert 0x10 not in bench.bits


def test_a_halt_before_any_move_stays_until_one_is_offered() -> None:
    bench = Bench().run(2, halt=1).run(5, halt=0)
    assert set(bench.bits) == {HALT}
    assert bench.run(30, request=1, target=300).phase == Phase.ARRIVED


@pytest.mark.parametrize(
    ("breaks", "failure"),
    [
        ({"deaf": True}, Failure.LATE_TAKEN),
        ({"deaf": True, "last": 0x10}, Failure.LATE_READY),
        ({"blocked": True}, Failure.LATE_ARRIVAL),
        ({"following": True}, Failure.FOLLOWING_ERROR),
    ],
)
def test_failures_are_named_and_halt(breaks: dict[str, Any], failure: Failure) -> None:
    bench = Bench()
    for name, value in breaks.items():
        setattr(bench.drive, name, value)
    bench.run(80, request=1, target=1500)
    assert (bench.phase, bench.state.failure) == (Phase.FAILED, failure)
    assert bench.out.mode_bits == HALT
    for name in breaks:
        setattr(bench.drive, name, False)
    bench.drive.last = 0
    assert bench.run(40, request=2).phase == Phase.ARRIVED


@pytest.mark.parametrize(
    ("phase", "word", "failure"),
    [
        (Phase.OFFERED, 0x1237, Failure.LATE_READY),
        (Phase.RAISED, 0x0237, Failure.LATE_TAKEN),
        (Phase.LOWERED, 0x1237, Failure.LATE_RELEASED),
        (Phase.MOVING, 0x0237, Failure.LATE_ARRIVAL),
    ],
)
def test_a_deadline_is_met_on_its_last_tick(phase: Phase, word: int, failure: Failure) -> None:
    limit = PARAMS.move_ticks if phase == Phase.MOVING else PARAMS.handshake_ticks
    state = pp.State(phase, 0, 1, 500, 0, 0, 1)
    for tick in range(2, limit + 2):
        state, _ = pp.step(PARAMS, state, Inputs(word, 0, 1, 1, 0, 0))
        assert state.failure == (failure if tick > limit else 0)


def test_the_target_is_offered_for_one_tick_and_no_longer() -> None:
    bench = Bench().run(1, request=1, target=500)
    assert (bench.phase, bench.out) == (Phase.OFFERED, (0, 500))
    assert bench.run(1).out == (0x30, 500)


def test_arrival_needs_the_window_for_the_settle_time() -> None:
    for gap, there in ((-11, False), (-10, True), (10, True), (11, False)):
        state = pp.State(Phase.MOVING, 0, 1, 500, 0, 0, 1)
        for tick in range(1, 6):
            state, _ = pp.step(PARAMS, state, Inputs(0x0637, 500 + gap, 1, 1, 0, 0))
            assert (state.phase == Phase.ARRIVED) == (there and tick >= PARAMS.settle_ticks)
    state = pp.State(Phase.MOVING, 0, 1, 500, 0, 0, 1)
    for word in [0x0637, 0x0637, 0x0237] * 5:  # near, but the drive does not keep saying so
        state, _ = pp.step(PARAMS, state, Inputs(word, 500, 1, 1, 0, 0))
        assert state.phase == Phase.MOVING


def test_a_following_error_counts_after_arrival_too() -> None:
    bench = Bench().run(40, request=1, target=300)
    bench.drive.following = True
    assert bench.run(2).state.failure == Failure.FOLLOWING_ERROR


def test_a_set_point_that_is_never_released() -> None:
    bench = Bench().run(4, request=1, target=1500)
    bench.drive.deaf = True
    assert bench.run(10).state.failure == Failure.LATE_RELEASED


def test_losing_the_drive_ends_the_move() -> None:
    bench = Bench().run(8, request=1, target=5000).run(1, acting=0)
    assert bench.state.failure == Failure.NOT_ACTING
    assert bench.run(20, acting=1).out.mode_bits == HALT
    assert Bench().run(1, request=1, acting=0).state.failure == Failure.NOT_ACTING


ticks = st.tuples(
    st.integers(0, 0xFFFF), st.integers(-100, 100), st.integers(0, 1), st.integers(0, 3),
    st.integers(-100, 100), st.integers(0, 1),
)  # fmt: skip


@given(st.lists(ticks))
def test_the_new_set_point_bit_is_set_only_while_the_drive_acts(ticks: list[Any]) -> None:
    state, last = pp.start(0), pp.Output(0, 0)
    for inputs in (Inputs(*tick) for tick in ticks):
        state, out = pp.step(PARAMS, state, inputs)
        assert out.mode_bits in (0, HALT, 0x30)
        if out.mode_bits == 0x30:
            assert (inputs.acting, inputs.halt) == (1, 0)
            assert out.target == last.target  # it was there a tick before
        if inputs.halt:
            assert out.mode_bits == HALT
        last = out
