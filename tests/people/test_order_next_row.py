"""The request `next_row` of an adaptive campaign: who may choose, when, and what need not move."""

from __future__ import annotations

from typing import Any

import pytest
from attended_run import AttendedRun
from core_runs import plan

from rig.realtime.safety import RUN, STOP_2
from rig.realtime.sequence import (
    CHOICE,
    DONE,
    MANUAL,
    MEASURE,
    MOVING,
    NO_ROW,
    SETTLE,
    WAIT_DRIVE,
    WAIT_ORDER,
    Phase,
)

PLACES = {0: 0.1, 1: 0.1, 2: 0.3}
_FIRST = (
    (NO_ROW, Phase.TARE, 5, 0, 0),
    (NO_ROW, Phase.MOVING, 2, WAIT_DRIVE, 0),
    (NO_ROW, Phase.LEAD_IN, 10, 0, 0),
)


def row_segments(row: int) -> tuple[Any, ...]:
    at = min(row, 1)  # the bench has two set points
    return (
        (NO_ROW, Phase.CHOICE, 1, WAIT_ORDER, min(max(row - 1, 0), 1)),
        (row, Phase.MOVING, 25, WAIT_DRIVE, at),
        (row, Phase.SETTLE, 30, 0, at),
        (row, Phase.MEASURE, 40, 0, at),
    )


CANDIDATES = plan(
    *_FIRST,
    *(segment for row in (0, 1, 2) for segment in row_segments(row)),
    (NO_ROW, Phase.CHOICE, 1, WAIT_ORDER, 1),
    timeout=1_000_000,
)


def make_run(**options: Any) -> AttendedRun:
    """Return a run that waits for the first choice."""
    run = AttendedRun(segments=CANDIDATES, places=PLACES, **options)
    run.power_on()
    assert run.row["plan.phase"] == CHOICE
    return run


def phases_of(run: AttendedRun, row: int) -> list[int]:
    phases = [each.plan.phase for each in run.rows if each.plan.row == row]
    return sorted(set(phases))


def measure(run: AttendedRun, row: int, session: str = "campaign") -> None:
    answer = run.ask(session, "next_row", row=row)
    assert answer.accepted, answer.reason
    run.go_on(120)
    assert run.row["plan.phase"] == CHOICE


# --- who, and when


def test_the_plan_waits_for_a_choice_with_the_set_point_of_the_last_row() -> None:
    run = make_run()
    measure(run, 1)
    run.go_on(5000)
    assert (run.row["plan.phase"], run.row["plan.row"], run.mode) == (CHOICE, NO_ROW, RUN)
    segment = run.execution.state.sequence.segment
    assert CANDIDATES.setpoint[segment] == CANDIDATES.setpoint[CANDIDATES.row.index(1)]


@pytest.mark.parametrize("session", ["command", "campaign", "page a"])
def test_people_and_the_campaign_choose(session: str) -> None:
    run = make_run()
    if session == "page a":
        assert not run.ask(session, "next_row", row=2).accepted
        run.ask(session, "take_seat")
    measure(run, 2, session)
    assert [each.accepted for each in run.journal.entries if each.request == "next_row"][-1]


def test_the_campaign_chooses_and_ends_while_an_operator_has_the_seat() -> None:
    run = make_run()
    assert run.ask("page a", "take_seat").accepted
    assert "page a is the operator" in run.ask("command", "next_row", row=1).reason
    measure(run, 1)
    assert not run.ask("campaign", "hold").accepted  # nothing else is its business
    assert not run.ask("campaign", "skip").accepted
    assert run.ask("campaign", "finish").accepted
    run.go_on(20)
    assert run.row["plan.phase"] == DONE


@pytest.mark.parametrize("session", ["command", "campaign", "page a"])
@pytest.mark.parametrize("request_", ["next_row", "finish"])
def test_viewers_do_not_choose(session: str, request_: str) -> None:
    run = make_run()
    answer = run.ask(session, request_, viewer=True, row=1)
    assert (answer.accepted, answer.reason) == (False, "viewers can only look")


@pytest.mark.parametrize("row", [3, -1, -2, 1.0, True, None, "1", [1]])
def test_only_candidates_can_be_chosen(row: Any) -> None:
    run = make_run()
    answer = run.ask("campaign", "next_row", row=row)
    assert not answer.accepted
    assert f"row {row!r}; allowed" in answer.reason
    assert not run.ask("campaign", "next_row").accepted
    measure(run, 0)


@pytest.mark.parametrize("when", ["standby", "lead-in", "row", "hold", "stopped", "done"])
def test_a_row_is_chosen_only_when_the_plan_waits_for_it(when: str) -> None:
    run = AttendedRun(segments=CANDIDATES, places=PLACES)
    if when != "standby":
        run.power_on()
    if when == "row":
        run.ask("campaign", "next_row", row=1)
        run.go_on(20)
    elif when == "hold":
        run.ask("command", "hold")
        run.go_on(20)
        assert run.mode == STOP_2
    elif when == "stopped":
        run.ask("command", "stop")
        run.go_on(20)
    elif when == "done":
        run.ask("campaign", "finish")
        run.go_on(20)
    elif when == "lead-in":
        run = AttendedRun(segments=CANDIDATES, places=PLACES)
        run.go_on(40)
        run.ask("command", "arm")
        run.ask("command", "confirm")
        while not run.rows or run.rows[-1].plan.phase != Phase.LEAD_IN:
            run.tick_once()
        run.poll()
    answer = run.ask("campaign", "next_row", row=2)
    assert (answer.accepted, answer.reason) == (False, "no row is to be chosen now")


def test_a_choice_before_the_first_tick_is_refused() -> None:
    run = AttendedRun(segments=CANDIDATES, places=PLACES)
    assert not run.ask("campaign", "next_row", row=1).accepted


def test_a_plan_without_choices_refuses() -> None:
    run = AttendedRun()
    run.power_on()
    assert run.ask("command", "next_row", row=1).reason == "no row is to be chosen now"


def test_the_second_of_two_choices_is_refused() -> None:
    run = make_run()
    assert run.ask("command", "next_row", row=1).accepted
    assert not run.ask("campaign", "next_row", row=2).accepted
    run.go_on(60)
    assert run.row["plan.row"] == 1


# --- the part that moves


def test_a_part_at_its_place_does_not_move() -> None:
    run = make_run()
    measure(run, 0)  # the lead-in has the place of the first candidate
    assert phases_of(run, 0) == [SETTLE, MEASURE]
    measure(run, 1)
    assert phases_of(run, 1) == [SETTLE, MEASURE]
    measure(run, 2)
    assert phases_of(run, 2) == [MOVING, SETTLE, MEASURE]
    run.rows.clear()
    measure(run, 1)
    assert phases_of(run, 1) == [MOVING, SETTLE, MEASURE]


def test_the_part_moves_after_manual_mode() -> None:
    run = make_run()
    measure(run, 0)
    run.ask("command", "hold")
    run.go_on(20)
    assert run.ask("command", "manual").accepted
    run.ask("command", "resume")
    run.go_on(40)
    assert run.mode == RUN
    assert run.ask("campaign", "next_row", row=1).reason == "the run is in manual mode"
    run.ask("command", "hold")
    run.go_on(20)
    assert run.ask("command", "campaign").accepted
    run.ask("command", "resume")
    run.go_on(40)
    assert run.row["plan.phase"] == CHOICE
    measure(run, 1)
    assert phases_of(run, 1) == [MOVING, SETTLE, MEASURE]


def test_manual_mode_within_a_choice_is_no_wait_for_one() -> None:
    """Else the virtual clock would stand still in manual mode."""
    run = make_run()
    run.go_on(1)
    assert run.execution.awaits_choice
    run.ask("command", "hold")
    run.go_on(20)
    assert not run.execution.awaits_choice
    run.ask("command", "manual")
    run.ask("command", "resume")
    run.go_on(20)
    assert (run.mode, run.row["plan.phase"]) == (RUN, MANUAL)
    segments, state = run.params.segments, run.execution.state.sequence
    assert segments.phase[state.segment] == CHOICE
    assert not run.execution.awaits_choice


def test_a_row_is_not_left_out_while_its_part_moves() -> None:
    """The part would be on its way, and the next row might start without waiting for it."""
    run = make_run()
    assert run.ask("campaign", "next_row", row=2).accepted
    run.go_on(10)
    assert run.row["plan.phase"] == MOVING
    assert "a part moves" in run.ask("command", "skip").reason
    run.go_on(30)
    assert run.row["plan.phase"] == SETTLE
    assert run.ask("command", "skip").reason == "row 2 is left out; another one is chosen"
    run.go_on(20)
    assert run.row["plan.phase"] == CHOICE
    measure(run, 2)


def test_a_hold_during_a_move_starts_it_over() -> None:
    run = make_run()
    run.ask("campaign", "next_row", row=2)
    run.go_on(5)
    run.ask("command", "hold")
    run.go_on(60)
    run.ask("command", "resume")
    run.go_on(10)
    assert (run.row["plan.row"], run.row["plan.phase"]) == (2, MOVING)


# --- the other requests


def test_a_hold_during_a_choice_returns_to_it() -> None:
    run = make_run()
    measure(run, 1)
    segment = run.execution.state.sequence.segment
    run.ask("command", "hold")
    run.go_on(40)
    run.ask("command", "resume")
    run.go_on(40)
    assert run.row["plan.phase"] == CHOICE
    assert run.execution.state.sequence.segment == segment
    measure(run, 0)


def test_a_row_in_a_choice_can_be_neither_skipped_nor_repeated() -> None:
    run = make_run()
    for name in ("skip", "repeat"):
        assert run.ask("command", name).reason == "no row runs now"


def test_the_last_candidate_can_be_left_out() -> None:
    run = make_run()
    run.ask("campaign", "next_row", row=2)
    run.go_on(60)
    assert run.ask("command", "skip").accepted
    run.go_on(20)
    assert (run.row["plan.phase"], run.mode) == (CHOICE, RUN)
    measure(run, 0)


def test_a_row_that_starts_over_is_another_attempt_and_another_row_is_not() -> None:
    run = make_run()
    measure(run, 2)
    measure(run, 0)  # before the last one in the plan
    assert {each.plan.attempt for each in run.rows} == {0}
    run.ask("campaign", "next_row", row=1)
    run.go_on(40)
    run.ask("command", "repeat")
    run.go_on(20)
    assert (run.row["plan.row"], run.row["plan.attempt"]) == (1, 1)
