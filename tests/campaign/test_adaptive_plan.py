"""The plan of an adaptive campaign: each candidate can follow each other, after a choice."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from random_examples import examples

from rig.campaign import all_rows, build_plan
from rig.campaign.plan import Measured, stage_plans
from rig.config.problems import ConfigError
from rig.kinds.wavebot.campaign import Plan, check_campaign, open_campaign
from rig.realtime.requests import NO_REQUEST
from rig.realtime.sequence import (
    CHOICE,
    DONE,
    LEAD_IN,
    MEASURE,
    MOVING,
    NO_ROW,
    SETTLE,
    TAIL,
    TARE,
    WAIT_ARRIVAL,
    WAIT_DRIVE,
    WAIT_ORDER,
    Segments,
    start,
    step,
)

ADAPTIVE = "adaptive: {precision_w: 0.3, first_rows: 2, max_rows: 3, start: nothing}\n"
SPRINGS = """\
matrix:
  list:
    - {spring_n_per_m: -10013, kp_n_s_per_m: -2000, ki_n_per_m: 9000}
    - {spring_n_per_m: 490.9, kp_n_s_per_m: -2000, ki_n_per_m: 20000}
    - {spring_n_per_m: 490.9, kp_n_s_per_m: -1000, ki_n_per_m: 0}
    - {spring_n_per_m: -10013, kp_n_s_per_m: -1000, ki_n_per_m: 0}
"""
ONE_SPRING = """\
matrix:
  grid:
    - {spring_n_per_m: 490.9, kp_n_s_per_m: [-1000, -1500, -2000, -2500], ki_n_per_m: 0}
"""
ROW = (SETTLE, MEASURE, TAIL)
ROW_S, MOVE_S, BEFORE_S = 20.0, 20.0, 5.0 + 0.5 + 120.0  # tare, preparation, lead-in


def plan_of(write: Any, body: str, measured: Measured | None = None) -> Plan:
    campaign = open_campaign(write(body))
    return build_plan(campaign) if measured is None else build_plan(campaign, measured)


def phases(planned: Plan) -> list[tuple[int, int]]:
    return list(zip(planned.segments.row, planned.segments.phase, strict=True))


def test_without_moves_each_row_is_between_two_choices(write: Any) -> None:
    planned = plan_of(write, ADAPTIVE + ONE_SPRING)
    expected = [(NO_ROW, TARE), (NO_ROW, MOVING), (NO_ROW, LEAD_IN), (NO_ROW, LEAD_IN)]
    for row in range(4):
        expected += [(NO_ROW, CHOICE), *((row, phase) for phase in ROW)]
    assert phases(planned) == [*expected, (NO_ROW, CHOICE), (NO_ROW, DONE)]


def test_with_moves_each_row_waits_for_the_part_with_a_ki_that_is_stable_anywhere(
    write: Any,
) -> None:
    """Also the first row, and rows at the place of the row before: an order may skip the wait."""
    planned = plan_of(write, ADAPTIVE + SPRINGS)
    table, points = planned.segments, planned.setpoints
    for row in range(4):
        own = [i for i, each in enumerate(table.row) if each == row]
        assert [table.phase[i] for i in own] == [MOVING, *ROW]
        moving, settle = own[:2]
        assert table.wait[moving] == WAIT_ARRIVAL | WAIT_DRIVE
        assert (table.ticks[moving], table.timeout[moving]) == (MOVE_S * 1000, 60_000)
        at, then = table.setpoint[moving], table.setpoint[settle]
        assert points.spring_rate[at] == points.spring_rate[then]
        assert points.law[0][at] == points.law[0][then]
    ki = [points.law[1][table.setpoint[table.row.index(row)]] for row in range(4)]
    anywhere = 24337 - 1.213 * 10013 - 3000  # of the lowest spring rate
    assert ki == pytest.approx([9000.0, anywhere, 0.0, 0.0])


@pytest.mark.parametrize("matrix", [SPRINGS, ONE_SPRING])
def test_a_choice_waits_for_an_order_with_the_set_point_before_it(write: Any, matrix: str) -> None:
    table = plan_of(write, ADAPTIVE + matrix).segments
    choices = [i for i, phase in enumerate(table.phase) if phase == CHOICE]
    assert len(choices) == 5
    for i in choices:
        assert table.setpoint[i] == table.setpoint[i - 1]
        assert (table.row[i], table.wait[i], table.ticks[i]) == (NO_ROW, WAIT_ORDER, 1)
        assert table.timeout[i] >= 1e9 * 1000
        assert (table.drive[i], table.waves[i], table.restart[i]) == (1, 1, i)


def orders(table: Segments, rows: list[int]) -> list[int]:
    """Return the phases and rows of ticks in which rows are chosen one after the other."""
    state, seen, request = start(0), [], NO_REQUEST
    everything = ~WAIT_ORDER
    left, tick = list(rows), 0
    while left or table.phase[state.segment] != CHOICE:
        phase = table.phase[state.segment]
        if phase == CHOICE and request.jump == state.jump:
            segment = table.row.index(left.pop(0))
            request = request._replace(jump=request.jump + 1, segment=segment)
        # Ticks in the middle of a segment change nothing.
        tick = max(tick + 1, state.entered + table.ticks[state.segment])
        state, _ = step(table, state, tick, everything, True, False, request)
        row = table.row[state.segment]
        if table.phase[state.segment] == MEASURE:
            seen.append(row)
            assert state.attempt == 0
    return seen


@settings(
    max_examples=examples(30),
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(order=st.lists(st.integers(0, 3), min_size=1, max_size=8))
def test_any_row_can_follow_any_other(plans: dict[str, Plan], order: list[int]) -> None:
    for planned in plans.values():
        assert orders(planned.segments, order) == order


@pytest.fixture
def plans(write: Any) -> dict[str, Plan]:
    return {name: plan_of(write, ADAPTIVE + name) for name in (SPRINGS, ONE_SPRING)}


def test_a_hold_during_a_choice_returns_to_the_same_one(plans: dict[str, Plan]) -> None:
    table = plans[SPRINGS].segments
    for i in (i for i, phase in enumerate(table.phase) if phase == CHOICE):
        state = start(0)._replace(segment=i)
        state, _ = step(table, state, 10, 0, False, True)
        state, _ = step(table, state, 20, 0, True, False)
        assert (state.segment, state.entered) == (i, 20)


def test_the_durations_are_those_of_the_most_and_the_fewest_rows(write: Any) -> None:
    planned = plan_of(write, ADAPTIVE + ONE_SPRING)
    assert planned.duration == BEFORE_S + 3 * ROW_S
    assert planned.least_duration == BEFORE_S + 2 * ROW_S
    assert planned.moves == 0
    planned = plan_of(write, ADAPTIVE + SPRINGS)
    assert planned.duration == BEFORE_S + 3 * (MOVE_S + ROW_S)
    assert planned.least_duration == BEFORE_S + 2 * (MOVE_S + ROW_S)
    assert planned.moves == 3


def test_a_resumed_plan_has_the_candidates_that_are_left(write: Any) -> None:
    planned = plan_of(write, ADAPTIVE + ONE_SPRING, Measured(frozenset({1, 2})))
    assert sorted({*planned.segments.row}) == [NO_ROW, 0, 3]
    assert planned.segments.phase.count(CHOICE) == 3
    assert len(planned.rows) == 4
    assert planned.duration == BEFORE_S + ROW_S  # one row is left of the three
    assert planned.least_duration == BEFORE_S
    over = plan_of(write, ADAPTIVE + ONE_SPRING, Measured(frozenset({0, 1, 2})))
    assert over.duration == BEFORE_S


def test_all_rows_and_stages_have_no_choices(write: Any) -> None:
    campaign = open_campaign(write(ADAPTIVE + SPRINGS))
    plain = open_campaign(write(SPRINGS))
    assert build_plan(all_rows(campaign)) == build_plan(plain)
    assert stage_plans(campaign) == stage_plans(plain)


def test_the_check_gives_the_durations_of_the_plan_not_those_of_all_candidates(write: Any) -> None:
    summary = check_campaign(write(f"{ONE_SPRING}{ADAPTIVE}")).summary()
    assert summary["duration_s"] == BEFORE_S + 3 * ROW_S
    assert summary["least_duration_s"] == BEFORE_S + 2 * ROW_S


def test_the_check_shows_at_most_so_many_rows(write: Any) -> None:
    report = check_campaign(write(ADAPTIVE + ONE_SPRING))
    text = report.text()
    assert "at most 3 of 4 points" in text
    assert "at least 2 rows, until the expected loss at electrical DC [dc] is within 0.3 W" in text
    assert "from nothing" in text
    assert json.loads(report.to_json())["adaptive"]["max_rows"] == 3


# --- rules of several keys (those of one key: broken_files.yaml)

HEAD = """\
name: test
rig: ../rigs/wavebot.yaml
sea: {kind: regular, amplitude_m: 0.1, frequency_hz: 0.5}
"""
TANK = "tank: {depth_m: 2.7, device_m: 28, length_m: 76, windows: end before the reflection}\n"
SEEDS = "seed: [1, 2]\nsea: {kind: jonswap, hs_m: 0.1, tp_s: 2.5}\n"


@pytest.mark.parametrize(
    ("body", "key", "message"),
    [
        (TANK + ONE_SPRING, "adaptive", "the tank ends the rows before reflected waves arrive"),
        ("device: absent\n", "adaptive", "there is no matrix to choose rows from"),
        (SEEDS + ONE_SPRING, "seed", "adaptive measures in one sea; allowed one seed"),
    ],
)
def test_campaigns_whose_rows_cannot_be_chosen(
    write: Any, body: str, key: str, message: str
) -> None:
    head = HEAD.replace("sea:", "# sea:") if body.startswith(SEEDS) else HEAD
    path = write(ADAPTIVE, head=head)
    path.write_text(head + ADAPTIVE + body)
    with pytest.raises(ConfigError) as caught:
        open_campaign(path)
    (problem,) = (each for each in caught.value.problems if each.key == key)
    assert message in problem.message


@pytest.mark.parametrize(
    ("adaptive", "key", "message"),
    [
        (
            "precision_w: 1, station: dx",
            "adaptive.station",
            "unknown station 'dx'; allowed mechanical (column load cell) [mechanical_1], "
            "mechanical (shaft torque sensor) [mechanical_2], electrical AC [ac], "
            "electrical DC [dc]",
        ),
        ("precision_w: 1, first_rows: 5", "matrix", "4 candidates; allowed 5 (first_rows) .. 1500"),
    ],
)
def test_rules_of_the_whole_campaign(write: Any, adaptive: str, key: str, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        open_campaign(write(f"adaptive: {{{adaptive}}}\n" + ONE_SPRING))
    (problem,) = caught.value.problems
    assert problem.key == key
    assert message in problem.message


def test_too_many_candidates(write: Any) -> None:
    kp, ki = "{from: -1, to: -79, step: -1}", "{from: 0, to: 18, step: 1}"
    row = f"{{spring_n_per_m: 490.9, kp_n_s_per_m: {kp}, ki_n_per_m: {ki}}}"
    body = f"adaptive: {{precision_w: 1}}\nmatrix: {{grid: [{row}]}}\n"
    with pytest.raises(ConfigError) as caught:
        open_campaign(write(body))
    assert "1501 candidates; allowed 4 (first_rows) .. 1500" in str(caught.value)
