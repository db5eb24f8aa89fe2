"""The plan with people: manual mode within a campaign, orders to jump, arming, manual plans."""

from __future__ import annotations

from typing import Any

import pytest
from core_runs import bench_params, plan
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from rig.people.attendance import NOBODY, Attendance, attendance, attended, record
from rig.realtime import sequence
from rig.realtime.live_setpoints import numbers_at, with_live_setpoint
from rig.realtime.requests import NO_REQUEST, Request
from rig.realtime.sequence import NO_ROW, WAIT_ARMED, WAIT_DRIVE, Phase, Segments, State

ROWS = plan(
    (NO_ROW, Phase.TARE, 3, 0, 0),
    (0, Phase.SETTLE, 4, 0, 0),
    (0, Phase.MEASURE, 6, 0, 0),
    (1, Phase.SETTLE, 4, 0, 1),
    (1, Phase.MEASURE, 6, 0, 1),
)
LAST = len(ROWS.row) - 1
MANUAL_PLAN = attended(bench_params(), Attendance(True, True, True)).segments


class Plan:
    """A plan that is stepped tick by tick."""

    def __init__(self, segments: Segments = ROWS) -> None:
        self.segments, self.state, self.tick = segments, sequence.start(0), -1

    def step(
        self, request: Request = NO_REQUEST, *, paused: bool = False, conditions: int = 3
    ) -> sequence.PlanEvents:
        self.tick += 1
        self.state, events = sequence.step(
            self.segments, self.state, self.tick, conditions, not paused, paused, request
        )
        return events

    def to(self, segment: int) -> Plan:
        while self.state.segment != segment:
            self.step()
        return self


def live(number: int) -> Request:
    return NO_REQUEST._replace(live=number)


def jump(segment: int, number: int = 1) -> Request:
    return NO_REQUEST._replace(jump=number, segment=segment)


def test_manual_mode_lasts_from_a_hold_to_the_next_and_the_row_then_starts_over() -> None:
    run = Plan().to(4)
    run.step(live(1), paused=True)
    assert (run.state.live, run.state.paused, run.state.segment) == (1, 1, 4)
    for _ in range(20):  # manual mode with the law acting: the plan does not advance
        assert run.step(live(1)) == (False, False)
    run.step(live(2))
    assert (run.state.live, run.state.segment) == (2, 4)
    run.step(live(0))  # only on hold the way leads back
    assert run.state.live == 2
    run.step(live(0), paused=True)
    assert (run.state.live, run.state.paused) == (0, 1)
    run.step(live(0))
    assert run.state == State(3, run.tick, 1, 0, 0, 0)


@given(st.integers(1, 5), st.integers(0, 30))
def test_a_set_point_is_not_taken_up_while_a_row_runs(number: int, ticks: int) -> None:
    run, alone = Plan(), Plan()
    for _ in range(ticks):
        assert run.step(live(number)) == alone.step()
        assert run.state == alone.state


@pytest.mark.parametrize("segment", range(LAST))
@pytest.mark.parametrize("paused", [False, True])
def test_a_jump_enters_its_segment_once(segment: int, *, paused: bool) -> None:
    run = Plan().to(3)
    run.step(jump(segment), paused=paused)
    assert (run.state.segment, run.state.entered) == (segment, run.tick)
    assert run.state.attempt == (1 if segment <= 3 else 0)
    entered = run.tick
    run.step(jump(segment), paused=paused)  # the same order again: no event
    assert run.state.entered == entered
    if paused:
        run.step(jump(segment))
        assert run.state.segment == ROWS.restart[segment]
        assert run.state.entered == run.tick


@pytest.mark.parametrize("manual", [0, 1])
@pytest.mark.parametrize("paused", [False, True])
def test_finish_ends_the_plan_from_every_state(manual: int, *, paused: bool) -> None:
    run = Plan().to(2)
    run.step(live(manual), paused=True)
    run.step(live(manual), paused=paused)
    events = run.step(jump(LAST)._replace(live=manual), paused=paused)
    assert events == (True, False)
    assert run.state == State(LAST, run.tick, run.state.attempt, 0, 0, 1)
    assert run.step(jump(LAST)) == (True, False)


def test_finish_ends_a_manual_plan() -> None:
    last = len(MANUAL_PLAN.row) - 1
    run = Plan(MANUAL_PLAN)
    for _ in range(200):
        run.step(live(1), conditions=WAIT_ARMED | WAIT_DRIVE)
    assert (run.state.segment, run.state.live) == (last - 1, 1)
    assert run.step(jump(last)._replace(live=1)).finished
    assert run.state.live == 0


@pytest.mark.parametrize("segment", [-1, LAST + 1, 2**40])
def test_a_jump_to_no_segment_is_ignored(segment: int) -> None:
    run, alone = Plan().to(2), Plan().to(2)
    run.step(jump(segment))
    alone.step()
    assert run.state == alone.state


def test_standby_waits_for_arming_without_end_and_tare_leads_back() -> None:
    armed = attended(bench_params(), Attendance(arming=True)).segments
    standby = armed.phase.index(Phase.STANDBY)
    run = Plan(armed).to(standby)
    for _ in range(5000):
        assert run.step(conditions=3) == (False, False)
    run.step(jump(0))
    assert (run.state.segment, armed.phase[0]) == (0, Phase.TARE)
    run.to(standby)
    run.step(conditions=3)
    run.step(conditions=3 | WAIT_ARMED)
    assert run.state.segment == standby + 1


@st.composite
def any_plans(draw: st.DrawFn) -> Segments:
    parts: list[tuple[int, Phase, int, int, int]] = []
    if draw(st.booleans()):
        parts.append((NO_ROW, Phase.TARE, 5, 0, 0))
    if draw(st.booleans()):
        parts.append((NO_ROW, Phase.MOVING, 2, WAIT_DRIVE, 0))
    if draw(st.booleans()):
        parts.append((NO_ROW, Phase.LEAD_IN, 5, 0, 0))
    for row in range(draw(st.integers(1, 4))):
        parts.append((row, draw(st.sampled_from([Phase.MOVING, Phase.SETTLE])), 3, 0, row))
        parts.append((row, Phase.MEASURE, 4, 0, row))
    return plan(*parts)


@given(any_plans())
def test_standby_stands_before_the_first_powered_segment(segments: Segments) -> None:
    params = bench_params(segments)
    found = attended(params, Attendance(arming=True)).segments
    at = segments.drive.index(1)
    assert (found.phase[at], found.drive[at], found.waves[at]) == (Phase.STANDBY, 0, 0)
    assert 1 not in found.drive[:at]
    without = Segments(*(column[:at] + column[at + 1 :] for column in found))
    moved = [i + (i >= at) for i in segments.restart]
    assert without == segments._replace(restart=tuple(moved))
    for i, restart in enumerate(found.restart):  # the same place as before
        assert found.row[restart] == found.row[i] or i == at


@given(any_plans(), st.booleans())
def test_a_manual_plan_is_preamble_open_segment_and_end(segments: Segments, arming: bool) -> None:
    found = attended(bench_params(segments), Attendance(True, arming, True)).segments
    last = len(found.phase) - 1
    assert found.phase.count(Phase.MANUAL) == 1
    assert (found.phase[last - 1], found.phase[last]) == (Phase.MANUAL, Phase.DONE)
    assert Phase.LEAD_IN not in found.phase
    assert set(found.row) == {NO_ROW}
    assert found.drive[last - 1] == 1
    assert (Phase.STANDBY in found.phase) is arming
    run = Plan(found)
    for _ in range(3000):
        assert not run.step(live(1), conditions=7).finished
        assert not run.step(live(2), conditions=7).timed_out
    assert (run.state.segment, run.state.live) == (last - 1, 2)


@given(
    st.lists(
        st.tuples(
            st.integers(0, 3), st.integers(0, 3), st.integers(-1, 8),
            st.sampled_from(["run", "hold", "hold", "stop"]), st.integers(1, 12),
        ),
        max_size=40,
    ),
    st.booleans(),
)  # fmt: skip
@settings(max_examples=examples(300))
def test_no_requests_lead_out_of_the_plan(steps: list[Any], manual: bool) -> None:
    """A valid segment, live only from hold or manual mode, DONE for good: always."""
    run = Plan(MANUAL_PLAN if manual else ROWS)
    for number, order, segment, state, ticks in steps:
        request = Request(0, 1, number, order, segment)
        for _ in range(ticks):
            before = run.state
            run.tick += 1
            run.state, events = sequence.step(
                run.segments, before, run.tick, 7, state == "run", state == "hold", request
            )
            after, last = run.state, len(run.segments.row) - 1
            assert 0 <= after.segment <= last
            assert 0 <= after.live <= 3
            if before.segment == last:
                assert after == before
                assert events.finished
            if state == "run" and before.live == 0 and after.live != 0:
                assert run.segments.phase[after.segment] == Phase.MANUAL
            if after.segment == last:
                assert after.live == 0


def test_the_record_of_a_plan_has_the_attendance() -> None:
    how = Attendance(True, True, False)
    assert attendance(record(how)) == how
    assert record(NOBODY) == {}
    assert attendance({}) == NOBODY
    params = bench_params()
    assert attended(params, NOBODY) is params


@given(st.lists(st.tuples(st.floats(-1e3, 0), st.floats(-1e3, 1e3)), min_size=1, max_size=8))
def test_a_set_point_never_changes_the_entry_in_force(sets: list[tuple[float, float]]) -> None:
    params = attended(bench_params(), Attendance(live=True))
    first = params.live_setpoint
    assert first == 2
    for number, numbers in enumerate(sets, 1):
        before = params
        params = with_live_setpoint(params, number, numbers)
        table = params.rig.setpoints
        assert numbers_at(table, first + (number & 1)) == numbers
        for at in (0, 1, first + (1 - (number & 1))):
            assert numbers_at(table, at) == numbers_at(before.rig.setpoints, at)
