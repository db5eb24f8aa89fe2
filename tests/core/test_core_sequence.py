"""Execution of any plan: order, lengths, waiting, holding, lost ticks, stopping."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import pytest
from core_runs import plan
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from rig.realtime import sequence
from rig.realtime.sequence import NO_ROW, Phase, Segments

FLAGS = 3
MANY = settings(max_examples=examples(200))


@st.composite
def plans(draw: st.DrawFn, waits: bool = True, min_ticks: int = 0) -> Segments:
    """Draw a plan of a preamble and some rows of some segments."""
    parts = [(NO_ROW, draw(st.integers(1, 3)))]
    parts += [(row, draw(st.integers(1, 4))) for row in range(draw(st.integers(1, 4)))]
    built = []
    for row, count in parts:
        for _ in range(count):
            wait = draw(st.integers(0, FLAGS)) if waits else 0
            built.append((row, Phase.SETTLE, draw(st.integers(min_ticks, 9)), wait, max(row, 0)))
    return plan(*built, timeout=draw(st.integers(0, 30)))


class PlanRun:
    """Runs a plan and records its segments."""

    def __init__(self, segments: Segments) -> None:
        self.segments = segments
        self.state = sequence.start(0)
        self.tick = -1
        self.visits: list[tuple[int, int]] = []  # segment, tick of entry

    def step(
        self, *, ready: int = FLAGS, running: bool = True, paused: bool = False, periods: int = 1
    ) -> sequence.PlanEvents:
        self.tick += periods
        if not self.visits:
            self.visits.append((0, 0))
        before = self.state
        self.state, events = sequence.step(
            self.segments, self.state, self.tick, ready, running, paused
        )
        entered = (self.state.segment, self.state.entered)
        if entered != (before.segment, before.entered):
            self.visits.append(entered)
        return events

    @property
    def done(self) -> bool:
        return self.segments.phase[self.state.segment] == Phase.DONE


def last_of(segments: Segments) -> int:
    return len(segments.phase) - 1


@MANY
@given(plans())
def test_every_segment_is_entered_once_in_order_and_lasts_its_ticks(segments: Segments) -> None:
    plan_run = PlanRun(segments)
    finished = [plan_run.step() for _ in range(sum(segments.ticks) + len(segments.ticks))]
    assert [segment for segment, _ in plan_run.visits] == list(range(last_of(segments) + 1))
    assert plan_run.state.attempt == 0
    assert plan_run.done
    assert finished[-1] == (True, False)
    assert not any(events.timed_out for events in finished)


@MANY
@given(plans(waits=False, min_ticks=1))
def test_without_waiting_every_entry_is_exact(segments: Segments) -> None:
    plan_run = PlanRun(segments)
    entries = list(itertools.accumulate(segments.ticks[:-1], initial=0))
    while not plan_run.done:
        events = plan_run.step()
        assert events.finished == plan_run.done
    assert plan_run.visits == list(zip(range(last_of(segments) + 1), entries, strict=True))
    assert plan_run.tick == entries[-1]


@MANY
@given(plans(), st.lists(st.integers(0, FLAGS), min_size=1, max_size=200))
def test_a_waiting_segment_ends_when_its_conditions_are_met(
    segments: Segments, flags: list[int]
) -> None:
    plan_run, flags_by_tick = PlanRun(segments), itertools.chain(flags, itertools.repeat(FLAGS))
    while not plan_run.done:
        i, entered = plan_run.state.segment, plan_run.state.entered
        ready = next(flags_by_tick)
        events = plan_run.step(ready=ready)
        elapsed = plan_run.tick - entered
        met = (segments.wait[i] & ready) == segments.wait[i]
        if elapsed >= segments.ticks[i] and met:
            assert plan_run.state.segment == i + 1
            planned = entered + segments.ticks[i]
            assert plan_run.state.entered == (plan_run.tick if segments.wait[i] else planned)
            assert not events.timed_out
        else:
            assert plan_run.state == (i, entered, 0, 0, 0, 0)
            waiting = elapsed >= segments.ticks[i]
            assert events.timed_out == (waiting and elapsed >= segments.timeout[i])
    assert [segment for segment, _ in plan_run.visits] == list(range(last_of(segments) + 1))


def test_a_timeout_counts_from_the_segment_entry() -> None:
    segments = plan((0, Phase.MOVING, 3, 2, 0), (0, Phase.MEASURE, 5, 0, 0), timeout=10)
    plan_run, late = PlanRun(segments), []
    for tick in range(16):
        late.append(plan_run.step(ready=2 if tick == 14 else 1).timed_out)
    assert late == [False] * 10 + [True] * 4 + [False] * 2
    assert plan_run.state[:2] == (1, 14)


@MANY
@given(plans(), st.integers(0, 60), st.integers(1, 20), st.integers(0, 30), st.integers(1, 9))
def test_a_hold_pauses_the_plan_and_restarts_the_row(
    segments: Segments, begin: int, length: int, restarted: int, second: int
) -> None:
    plan_run, attempts = PlanRun(segments), [0] * (last_of(segments) + 1)
    for _ in range(begin):
        plan_run.step()
    for span, gap in ((length, restarted), (second, 0)):
        if plan_run.done:
            return
        frozen = plan_run.state.segment, plan_run.state.entered, plan_run.state.attempt
        for _ in range(span):
            assert plan_run.step(running=False, paused=True) == (False, False)
            assert plan_run.state == (*frozen, 1, 0, 0)
        plan_run.step()
        assert plan_run.state.paused == 0
        start = segments.restart[frozen[0]]
        # A segment of zero length may end in its first tick.
        assert plan_run.state.segment in (start, start + 1)
        assert plan_run.visits[-1][1] >= plan_run.tick - segments.ticks[start]
        if plan_run.state.segment == start:
            assert plan_run.state == (start, plan_run.tick, frozen[2] + 1, 0, 0, 0)
        assert segments.row[start] == segments.row[frozen[0]]
        attempts[frozen[0]] += 1
        for _ in range(gap):
            plan_run.step()
    while not plan_run.done:
        row, attempt = segments.row[plan_run.state.segment], plan_run.state.attempt
        plan_run.step()
        same = segments.row[plan_run.state.segment] == row
        assert plan_run.state.attempt == (attempt if same else 0)


def test_attempts_count_every_hold_of_the_row() -> None:
    segments = plan(
        (0, Phase.SETTLE, 5, 0, 0), (0, Phase.MEASURE, 10, 0, 0), (1, Phase.SETTLE, 5, 0, 1)
    )
    plan_run, visited = PlanRun(segments), []
    for tick in range(60):
        paused = tick in (7, 8, 20, 40)
        plan_run.step(running=not paused, paused=paused)
        visited.append((plan_run.state.segment, plan_run.state.attempt))
    assert visited[6] == visited[8] == (1, 0)
    assert visited[9] == (0, 1)  # restarts with its settling
    assert visited[14] == (1, 1)
    assert visited[21] == (0, 2)
    assert visited[36] == (2, 0)  # the next row is in its first attempt
    assert visited[41] == (2, 1)
    assert visited[46] == (3, 0)


@MANY
@given(plans(), st.integers(0, 60), st.lists(st.booleans(), min_size=5, max_size=40))
def test_a_stopped_plan_never_continues(segments: Segments, when: int, later: list[bool]) -> None:
    plan_run = PlanRun(segments)
    for _ in range(when):
        plan_run.step()
    left = plan_run.done
    attempt = plan_run.state.attempt
    events = plan_run.step(running=False)
    assert events.finished == left  # a stopped plan is not finished in that tick
    assert plan_run.done
    assert plan_run.state.attempt == attempt
    for flag in later:
        assert plan_run.step(running=flag, paused=not flag) == (True, False)
        assert plan_run.done


@MANY
@given(plans(waits=False, min_ticks=4), st.lists(st.integers(1, 4), min_size=1, max_size=60))
def test_lost_ticks_do_not_shift_the_plan(segments: Segments, gaps: list[int]) -> None:
    """With gaps shorter than any segment, every segment begins on its planned tick."""
    plan_run, periods = PlanRun(segments), itertools.cycle(gaps)
    while not plan_run.done:
        plan_run.step(periods=next(periods))
    entries = itertools.accumulate(segments.ticks[:-1], initial=0)
    assert plan_run.visits == list(zip(range(last_of(segments) + 1), entries, strict=True))


@pytest.mark.parametrize("lost", [5, 50])
def test_a_gap_over_several_segments_skips_none(lost: int) -> None:
    segments = plan(*((0, Phase.SETTLE, 3, 0, 0) for _ in range(5)))
    plan_run = PlanRun(segments)
    plan_run.step()
    plan_run.step(periods=lost)
    while not plan_run.done:
        plan_run.step()
    assert [segment for segment, _ in plan_run.visits] == [0, 1, 2, 3, 4, 5]


def test_phase_numbers_match_recorded_files() -> None:
    names: Callable[[int], str] = lambda number: Phase(number).name  # noqa: E731
    assert [names(n) for n in range(7)] == [
        "TARE", "LEAD_IN", "MOVING", "SETTLE", "MEASURE", "TAIL", "DONE",
    ]  # fmt: skip


def test_conditions_are_different_bits() -> None:
    assert (sequence.WAIT_ARRIVAL, sequence.WAIT_DRIVE) == (1, 2)
