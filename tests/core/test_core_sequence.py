"""Walking any plan: order, lengths, waiting, holding, lost ticks, leaving for good."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import pytest
from core_runs import plan
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.realtime import sequence
from rig.realtime.sequence import NO_ROW, Phase, Segments

FLAGS = 3
MANY = settings(max_examples=200, deadline=None)


@st.composite
def plans(draw: st.DrawFn, waits: bool = True, least: int = 0) -> Segments:
    """Any plan of a preamble and some rows of some segments."""
    parts = [(NO_ROW, draw(st.integers(1, 3)))]
    parts += [(row, draw(st.integers(1, 4))) for row in range(draw(st.integers(1, 4)))]
    made = []
    for row, count in parts:
        for _ in range(count):
            wait = draw(st.integers(0, FLAGS)) if waits else 0
            made.append((row, Phase.SETTLE, draw(st.integers(least, 9)), wait, max(row, 0)))
    return plan(*made, timeout=draw(st.integers(0, 30)))


class Walk:
    """A walk and what was seen on it."""

    def __init__(self, segments: Segments) -> None:
        self.segments = segments
        self.state = sequence.start(0)
        self.tick = -1
        self.visits: list[tuple[int, int]] = []  # segment, tick of entry

    def step(
        self, *, ready: int = FLAGS, running: bool = True, held: bool = False, periods: int = 1
    ) -> sequence.Position:
        self.tick += periods
        if not self.visits:
            self.visits.append((0, 0))
        before = self.state
        self.state, position = sequence.step(
            self.segments, self.state, self.tick, ready, running, held
        )
        entered = (self.state.segment, self.state.entered)
        if entered != (before.segment, before.entered):
            self.visits.append(entered)
        return position

    @property
    def done(self) -> bool:
        return self.segments.phase[self.state.segment] == Phase.DONE


def last_of(segments: Segments) -> int:
    return len(segments.phase) - 1


@MANY
@given(plans())
def test_every_segment_is_entered_once_in_order_and_lasts_its_ticks(segments: Segments) -> None:
    walk = Walk(segments)
    finished = [walk.step() for _ in range(sum(segments.ticks) + len(segments.ticks))]
    assert [segment for segment, _ in walk.visits] == list(range(last_of(segments) + 1))
    assert walk.state.attempt == 0
    assert walk.done
    assert finished[-1] == (True, False)
    assert not any(position.late for position in finished)


@MANY
@given(plans(waits=False, least=1))
def test_without_waiting_every_entry_is_exact(segments: Segments) -> None:
    walk = Walk(segments)
    entries = list(itertools.accumulate(segments.ticks[:-1], initial=0))
    while not walk.done:
        position = walk.step()
        assert position.finished == walk.done
    assert walk.visits == list(zip(range(last_of(segments) + 1), entries, strict=True))
    assert walk.tick == entries[-1]


@MANY
@given(plans(), st.lists(st.integers(0, FLAGS), min_size=1, max_size=200))
def test_a_segment_that_waits_ends_when_its_flags_hold(
    segments: Segments, flags: list[int]
) -> None:
    walk, given_flags = Walk(segments), itertools.chain(flags, itertools.repeat(FLAGS))
    while not walk.done:
        i, entered = walk.state.segment, walk.state.entered
        ready = next(given_flags)
        position = walk.step(ready=ready)
        elapsed = walk.tick - entered
        met = (segments.wait[i] & ready) == segments.wait[i]
        if elapsed >= segments.ticks[i] and met:
            assert walk.state.segment == i + 1
            planned = entered + segments.ticks[i]
            assert walk.state.entered == (walk.tick if segments.wait[i] else planned)
            assert not position.late
        else:
            assert walk.state == (i, entered, 0, 0)
            waiting = elapsed >= segments.ticks[i]
            assert position.late == (waiting and elapsed >= segments.timeout[i])
    assert [segment for segment, _ in walk.visits] == list(range(last_of(segments) + 1))


def test_a_timeout_counts_from_the_entry_and_lasts_until_the_flag_holds() -> None:
    segments = plan((0, Phase.MOVING, 3, 2, 0), (0, Phase.MEASURE, 5, 0, 0), timeout=10)
    walk, late = Walk(segments), []
    for tick in range(16):
        late.append(walk.step(ready=2 if tick == 14 else 1).late)
    assert late == [False] * 10 + [True] * 4 + [False] * 2
    assert walk.state[:2] == (1, 14)


@MANY
@given(plans(), st.integers(0, 60), st.integers(1, 20), st.integers(0, 30), st.integers(1, 9))
def test_a_hold_freezes_the_plan_and_the_row_starts_over(
    segments: Segments, begin: int, length: int, again: int, second: int
) -> None:
    walk, attempts = Walk(segments), [0] * (last_of(segments) + 1)
    for _ in range(begin):
        walk.step()
    for span, gap in ((length, again), (second, 0)):
        if walk.done:
            return
        frozen = walk.state.segment, walk.state.entered, walk.state.attempt
        for _ in range(span):
            assert walk.step(running=False, held=True) == (False, False)
            assert walk.state == (*frozen, 1)
        walk.step()
        assert walk.state.paused == 0
        start = segments.restart[frozen[0]]
        # A segment of no length may be over in the tick it starts in.
        assert walk.state.segment in (start, start + 1)
        assert walk.visits[-1][1] >= walk.tick - segments.ticks[start]
        if walk.state.segment == start:
            assert walk.state == (start, walk.tick, frozen[2] + 1, 0)
        assert segments.row[start] == segments.row[frozen[0]]
        attempts[frozen[0]] += 1
        for _ in range(gap):
            walk.step()
    while not walk.done:
        row, attempt = segments.row[walk.state.segment], walk.state.attempt
        walk.step()
        same = segments.row[walk.state.segment] == row
        assert walk.state.attempt == (attempt if same else 0)


def test_attempts_count_every_hold_of_the_row() -> None:
    segments = plan(
        (0, Phase.SETTLE, 5, 0, 0), (0, Phase.MEASURE, 10, 0, 0), (1, Phase.SETTLE, 5, 0, 1)
    )
    walk, seen = Walk(segments), []
    for tick in range(60):
        held = tick in (7, 8, 20, 40)
        walk.step(running=not held, held=held)
        seen.append((walk.state.segment, walk.state.attempt))
    assert seen[6] == seen[8] == (1, 0)
    assert seen[9] == (0, 1)  # starts over with its settling
    assert seen[14] == (1, 1)
    assert seen[21] == (0, 2)
    assert seen[36] == (2, 0)  # the next row is at its first attempt
    assert seen[41] == (2, 1)
    assert seen[46] == (3, 0)


@MANY
@given(plans(), st.integers(0, 60), st.lists(st.booleans(), min_size=5, max_size=40))
def test_left_for_good(segments: Segments, when: int, later: list[bool]) -> None:
    walk = Walk(segments)
    for _ in range(when):
        walk.step()
    left = walk.done
    attempt = walk.state.attempt
    position = walk.step(running=False)
    assert position.finished == left  # a plan that was left is not finished in that tick
    assert walk.done
    assert walk.state.attempt == attempt
    for flag in later:
        assert walk.step(running=flag, held=not flag) == (True, False)
        assert walk.done


@MANY
@given(plans(waits=False, least=4), st.lists(st.integers(1, 4), min_size=1, max_size=60))
def test_lost_ticks_do_not_move_what_is_planned(segments: Segments, gaps: list[int]) -> None:
    """Gaps shorter than any segment: every segment begins on its planned tick all the same."""
    walk, periods = Walk(segments), itertools.cycle(gaps)
    while not walk.done:
        walk.step(periods=next(periods))
    entries = itertools.accumulate(segments.ticks[:-1], initial=0)
    assert walk.visits == list(zip(range(last_of(segments) + 1), entries, strict=True))


@pytest.mark.parametrize("lost", [5, 50])
def test_a_gap_over_several_segments_skips_none(lost: int) -> None:
    segments = plan(*((0, Phase.SETTLE, 3, 0, 0) for _ in range(5)))
    walk = Walk(segments)
    walk.step()
    walk.step(periods=lost)
    while not walk.done:
        walk.step()
    assert [segment for segment, _ in walk.visits] == [0, 1, 2, 3, 4, 5]


def test_phases_have_the_numbers_that_are_in_recorded_files() -> None:
    names: Callable[[int], str] = lambda number: Phase(number).name  # noqa: E731
    assert [names(n) for n in range(7)] == [
        "TARE", "LEAD_IN", "MOVING", "SETTLE", "MEASURE", "TAIL", "DONE",
    ]  # fmt: skip


def test_conditions_are_different_bits() -> None:
    assert (sequence.WAIT_STATOR, sequence.WAIT_DRIVE) == (1, 2)
