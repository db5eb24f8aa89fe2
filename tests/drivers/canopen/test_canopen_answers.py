"""Matching of statuses with SYNCs by counting: delays, losses, copies and dividers."""

from __future__ import annotations

from collections import deque

import pytest
from canopen_drives import OWN, FakeLink, axis_settings
from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen import pdo, sync_count
from drivers.canopen.bus_cycle import SYNC, BusCycle
from drivers.canopen.link import Frame
from drivers.canopen.sync_count import MAX_OPEN, WINDOW, AnswerCount
from drivers.canopen.torque_axis import TorqueAxis, layouts

NODE, DT = 5, 0.001
STATUS = layouts(NODE, 0).status


class Wire:
    """A node that answers every ``each``-th SYNC with its number, and a wire that may delay it."""

    def __init__(self, each: int = 1) -> None:
        self.each, self.syncs = each, 0
        self.queued: deque[int] = deque()
        self.state = sync_count.start()

    def sync(self) -> None:
        self.syncs += 1
        if self.syncs % self.each == 0:
            self.queued.append(self.syncs)

    def give(self, count: int | None = None) -> list[tuple[int, int]]:
        """Deliver ``count`` answers (None: all); return the counted and the true SYNC of each."""
        ages = []
        for _ in range(len(self.queued) if count is None else min(count, len(self.queued))):
            true = self.queued.popleft()
            self.state = sync_count.record_answer(self.state, self.each, self.syncs)
            ages.append((self.state.answered, true))
        return ages

    def settle(self, ticks: int = 5) -> None:
        for _ in range(ticks * self.each):
            self.sync()
            self.give()


def test_the_first_answer_is_one_to_the_last_sync() -> None:
    assert sync_count.record_answer(sync_count.start(), 1, 7).answered == 7
    assert (
        sync_count.record_answer(sync_count.start(), 1, 0).answered == 0
    )  # to none: there was no SYNC yet


@pytest.mark.parametrize("each", [1, 2, 10, 20])
@pytest.mark.parametrize("stalled", [1, 60, 200])
def test_answers_arriving_together_have_their_true_ages(each: int, stalled: int) -> None:
    """The answers of a host stall of 60 ms arrive in one read, or in pieces."""
    wire = Wire(each)
    wire.settle()
    for _ in range(stalled):
        wire.sync()
    assert all(counted == true for counted, true in wire.give(stalled // (2 * each)))
    wire.sync()
    assert all(counted == true for counted, true in wire.give())


@given(st.lists(st.integers(0, 9), max_size=400), st.sampled_from([1, 3, 10]))
def test_delayed_answers_are_never_mistaken_for_others(given: list[int], each: int) -> None:
    """With any delays, as long as the wire is empty now and then and no answer is lost."""
    wire = Wire(each)
    wire.settle()
    for k, count in enumerate(given):
        wire.sync()
        ages = wire.give(None if k % (WINDOW // 2) == 0 else count)
        assert all(counted == true for counted, true in ages)


@pytest.mark.parametrize("each", [1, 10])
@pytest.mark.parametrize("lost", [1, 7])
def test_a_lost_answer_makes_the_others_older_for_two_windows_at_most(lost: int, each: int) -> None:
    wire = Wire(each)
    wire.settle(3 * WINDOW // each)
    for _ in range(lost * each):
        wire.sync()
    wire.queued.clear()
    began, older = wire.syncs, 0
    while wire.syncs < began + 2 * (WINDOW + each):
        wire.sync()
        ages = wire.give()
        assert all(counted <= true for counted, true in ages)
        older += sum(counted < true for counted, true in ages)
    assert older > 0
    for _ in range(each):
        wire.sync()
    counted, true = wire.give()[-1]
    assert counted == true


def test_a_silence_longer_than_a_window_is_not_taken_for_a_loss() -> None:
    """Answers from before the reconnection stay old, whenever the previous window ended."""
    for settled in range(WINDOW, 2 * WINDOW):
        wire = Wire()
        wire.settle(settled)
        for _ in range(2 * WINDOW):
            wire.sync()
        assert all(counted == true for counted, true in wire.give())


def test_copies_are_never_answers_to_a_sync_to_come() -> None:
    state = AnswerCount(0, 0, -1)
    for number in range(1, 500):
        for _ in range(2):
            state = sync_count.record_answer(state, 1, number)
            assert state.answered == number


# --- on the bus: ages


class Bench:
    def __init__(self) -> None:
        self.line = FakeLink()
        self.axis = TorqueAxis(axis_settings(NODE))
        self.bus = BusCycle(self.line, [self.axis], OWN, 0.05)
        self.queued: list[Frame] = []
        self.sampled: dict[int, float] = {}  # counts, and when the SYNC went out they answer

    def tick(self, through: int | None = None) -> float:
        """Tick and deliver ``through`` queued answers; return reported age less true age."""
        count = len(self.queued) if through is None else through
        self.line.incoming, self.queued = self.queued[:count], self.queued[count:]
        now = self.bus.receive()
        self.bus.send([self.axis.command(0.0, 0, now)])
        counts = len(self.sampled) + 1
        self.sampled[counts] = self.line.time
        self.queued.append(Frame(STATUS.cob_id, pdo.pack(STATUS, 0x240, 0, counts)))
        self.line.time += DT
        reading = self.axis.read(now)
        return reading.age - (now - self.sampled[reading.counts]) if reading.counts else 0.0


def test_ages_of_a_host_that_stands_still_for_60_ms_are_the_true_ones() -> None:
    bench = Bench()
    off = [bench.tick() for _ in range(200)]
    off += [bench.tick(0) for _ in range(60)]
    off += [bench.tick(17) for _ in range(4)]
    off += [bench.tick() for _ in range(200)]
    assert max(abs(one) for one in off) < 1e-9


def test_the_answer_to_a_sync_too_long_ago_is_as_old_as_can_be() -> None:
    bench = Bench()
    for _ in range(20):
        bench.tick()
    for _ in range(MAX_OPEN + 10):
        bench.tick(0)
    bench.tick(1)
    assert bench.axis.read(bench.line.time).age > 1e6
    for _ in range(2 * WINDOW):
        assert bench.tick() >= 0.0
    assert bench.axis.read(bench.line.time).age == pytest.approx(2 * DT)


def test_a_sync_that_the_bus_did_not_take_is_not_counted() -> None:
    bench = Bench()
    for _ in range(20):
        bench.tick()
    bench.line.refused_ids = frozenset({SYNC})
    for _ in range(30):
        bench.tick(0)
        bench.queued.pop()  # no SYNC was sent
    bench.line.refused_ids = frozenset()
    bench.tick()
    assert bench.axis.read(bench.line.time - DT).age == pytest.approx(31 * DT)
    bench.tick()
    assert bench.axis.read(bench.line.time - DT).age == pytest.approx(DT)
