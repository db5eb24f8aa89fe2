"""Unwrapping compared with the original motion, and motions that no machine can do."""

from __future__ import annotations

import math

from hypothesis import given
from hypothesis import strategies as st

from drivers.encoder.unwrap import Outcome, Params, State, angle, start, step

TURN = 1 << 19
# 60 rad/s is nearly ten turns a second; 1 ms at that speed is 5007 counts.
PARAMS = Params(TURN, 60.0, 4.0)


def run(params: Params, samples: list[tuple[int, int]]) -> tuple[State, list[Outcome]]:
    state, outcomes = start(), []
    for position, time_us in samples:
        state, outcome = step(params, state, position, time_us)
        outcomes.append(outcome)
    return state, outcomes


def test_the_first_count_fixes_the_turn() -> None:
    state, outcomes = run(PARAMS, [(TURN // 4, 123)])
    assert outcomes == [Outcome.ACCEPTED]
    assert angle(PARAMS, state) == math.tau / 4.0


def test_it_crosses_zero_both_ways() -> None:
    up, _ = run(PARAMS, [(TURN - 10, 0), (10, 1000)])
    down, _ = run(PARAMS, [(10, 0), (TURN - 10, 1000)])
    assert up.position == TURN + 10
    assert down.position == -10
    assert angle(PARAMS, down) == -10 * (math.tau / TURN)


@given(
    st.integers(0, TURN - 1),
    st.lists(st.tuples(st.integers(-5000, 5000), st.integers(1000, 3000)), max_size=200),
)
def test_any_motion_the_speed_allows_comes_back_exactly(
    begin: int, moves: list[tuple[int, int]]
) -> None:
    position, now, samples = begin, 0, [(begin, 0)]
    for move, gap in moves:
        position, now = position + move, now + gap
        samples.append((position % TURN, now))
    state, outcomes = run(PARAMS, samples)
    assert set(outcomes) == {Outcome.ACCEPTED}
    assert state == State(1, 0, position, now, 0, 0, 0)


def test_the_gate_is_speed_times_time_plus_slack() -> None:
    reach = 60.0 * 1e-3 * TURN / math.tau + 4.0
    within, beyond = math.floor(reach), math.floor(reach) + 1
    for sign in (1, -1):
        begin = TURN // 2
        assert run(PARAMS, [(begin, 0), (begin + sign * within, 1000)])[1][1] is Outcome.ACCEPTED
        assert run(PARAMS, [(begin, 0), (begin + sign * beyond, 1000)])[1][1] is Outcome.JUMPED


def test_the_ends_of_the_gate_belong_to_it_and_half_a_turn_does_not() -> None:
    still = Params(16, 1.0, 4.0)  # no time passes, so the slack is the gate
    for position, expected in ((12, Outcome.ACCEPTED), (4, Outcome.ACCEPTED), (3, Outcome.JUMPED)):
        assert run(still, [(8, 0), (position, 0)])[1][1] is expected
    half = Params(16, 1.0, 8.0)
    assert run(half, [(8, 0), (8, 0)])[1][1] is Outcome.LOST


def test_a_jump_is_counted_and_leaves_the_angle() -> None:
    state, outcomes = run(PARAMS, [(100, 0), (200_000, 1000), (150, 2000)])
    assert outcomes == [Outcome.ACCEPTED, Outcome.JUMPED, Outcome.ACCEPTED]
    assert (state.position, state.jumped, state.time_us) == (150, 1, 2000)


def test_after_a_jump_that_stays_the_turns_are_lost_not_guessed() -> None:
    """Slip, or the wrong encoder: the gate opens with time, but closes before half a turn."""
    samples = [(0, 0), *((TURN // 2, 1000 * n) for n in range(1, 200))]
    state, outcomes = run(PARAMS, samples)
    assert Outcome.ACCEPTED not in outcomes[1:]
    assert outcomes[-1] is Outcome.LOST
    first_lost = outcomes.index(Outcome.LOST)
    assert first_lost == math.ceil(math.pi / 60.0 * 1e3 * (1 - 8 / TURN))
    assert (state.lost, state.jumped) == (1, first_lost - 1)


def test_a_pause_too_long_loses_the_turns_even_if_the_count_looks_near() -> None:
    state, outcomes = run(PARAMS, [(100, 0), (101, 60_000), (101, 60_001)])
    assert outcomes == [Outcome.ACCEPTED, Outcome.LOST, Outcome.LOST]
    assert state.position == 100


def test_counts_outside_a_turn_are_refused() -> None:
    state, outcomes = run(PARAMS, [(TURN, 0), (-1, 0), (5, 0), (TURN, 1000)])
    refused = Outcome.OUT_OF_TURN
    assert outcomes == [refused, refused, Outcome.ACCEPTED, refused]
    assert state.out_of_turn == 3


def test_time_that_goes_back_is_refused_and_time_that_stands_allows_noise() -> None:
    state, outcomes = run(PARAMS, [(5, 1000), (5, 999), (9, 1000), (14, 1000)])
    taken, back, jumped = Outcome.ACCEPTED, Outcome.BACK_IN_TIME, Outcome.JUMPED
    assert outcomes == [taken, back, taken, jumped]
    assert (state.back_in_time, state.jumped) == (1, 1)


samples = st.lists(st.tuples(st.integers(-10, 1 << 22), st.integers(-(10**6), 10**12)), max_size=30)


@given(st.integers(1, 1 << 22), st.floats(1e-3, 1e5), st.floats(0.0, 100.0), samples)
def test_any_samples_are_counted_once_each(
    turn: int, speed: float, slack: float, taken: list[tuple[int, int]]
) -> None:
    params = Params(turn, speed, slack)
    state, outcomes = run(params, taken)
    assert state.jumped == outcomes.count(Outcome.JUMPED)
    assert state.out_of_turn == outcomes.count(Outcome.OUT_OF_TURN)
    assert state.back_in_time == outcomes.count(Outcome.BACK_IN_TIME)
    assert state.lost == int(Outcome.LOST in outcomes)
    assert math.isfinite(angle(params, state))
    if Outcome.LOST in outcomes:
        assert set(outcomes[outcomes.index(Outcome.LOST) :]) == {Outcome.LOST}
