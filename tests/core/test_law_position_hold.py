"""Position hold: start without a jolt, bounded motion of the target, arrival on time."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from controllers import position_hold
from controllers.blocks import finite
from controllers.position_hold import Params
from controllers.signals import Estimate

DT = 0.001
LAW = Params(ramp=0.05, stiffness=2e4, damping=3e3, speed=0.1, acceleration=0.2)
WEIRD = [math.nan, math.inf, -math.inf]
PLACE = st.floats(-0.5, 0.5)


def at(x: float, v: float = 0.0) -> Estimate:
    return Estimate(x, v, 0.0)


def settled_state(params: Params, x: float) -> position_hold.State:
    """Return the state after holding ``x`` for a while."""
    state = position_hold.start()
    for _ in range(200):
        state, _ = position_hold.step(params, state, x, at(x), DT)
    return state


@given(PLACE, PLACE, st.floats(-1.0, 1.0))
def test_the_force_is_spring_and_damper_to_the_target(goal: float, x: float, v: float) -> None:
    state, demand = position_hold.step(LAW, settled_state(LAW, goal), goal, at(x, v), DT)
    assert state.target == goal
    assert demand[:3] == (-3e3, -2e4, 0.0)
    assert demand.force == pytest.approx(-2e4 * (x - goal) - 3e3 * v, rel=1e-12, abs=1e-9)


@given(PLACE, PLACE, st.floats(-1.0, 1.0))
def test_the_hold_starts_at_the_axis_without_a_jolt(x: float, goal: float, v: float) -> None:
    state, demand = position_hold.step(LAW, position_hold.start(), goal, at(x, v), DT)
    tick = DT / LAW.ramp
    bound = 3e3 * abs(v) * tick + 2e4 * tick * LAW.acceleration * DT * DT
    assert abs(demand.force) <= bound * (1.0 + 1e-9)
    assert abs(state.target - x) <= LAW.acceleration * DT * DT * (1.0 + 1e-9)


def ways(params: Params, x: float, goals: list[tuple[float, int]]) -> np.ndarray:
    """Return the target tick by tick, from ``x`` through goals that last given ticks."""
    state, out = settled_state(params, x), [x]
    for goal, ticks in goals:
        for _ in range(ticks):
            state, _ = position_hold.step(params, state, goal, at(x), DT)
            out.append(state.target)
    return np.array(out)


@settings(max_examples=examples(60))
@given(
    PLACE,
    st.lists(st.tuples(PLACE, st.integers(1, 3000)), min_size=1, max_size=4),
    st.floats(0.01, 0.5),
    st.floats(0.05, 2.0),
)
def test_the_target_keeps_its_speed_and_acceleration(
    x: float, goals: list[tuple[float, int]], speed: float, acceleration: float
) -> None:
    """For any change of goal; only the last tick may brake up to three times as hard."""
    law = LAW._replace(speed=speed, acceleration=acceleration)
    x_t = ways(law, x, goals)
    v = np.diff(x_t, prepend=x) / DT
    assert np.abs(v).max() <= speed * (1.0 + 1e-9) + 1e-9
    a = np.abs(np.diff(v)) / DT
    hard = a > acceleration * (1.0 + 1e-6) + 1e-6
    stopped = {goal for goal, _ in goals}
    for tick in np.flatnonzero(hard):
        assert x_t[tick + 1] in stopped or x_t[tick] in stopped  # v[tick + 1] ends at x_t[tick + 1]
        assert a[tick] <= 3.0 * acceleration * (1.0 + 1e-6) + 1e-6


@settings(max_examples=examples(60))
@given(PLACE, PLACE, st.floats(0.05, 0.5), st.floats(0.1, 2.0))
def test_the_target_arrives_on_time_without_overshoot(
    x: float, goal: float, speed: float, acceleration: float
) -> None:
    """d / v + v / a, or 2 sqrt(d / a) if it never reaches v, within three ticks."""
    law = LAW._replace(speed=speed, acceleration=acceleration)
    d = abs(goal - x)
    takes = (
        d / speed + speed / acceleration
        if d * acceleration >= speed * speed
        else 2.0 * math.sqrt(d / acceleration)
    )
    x_t = ways(law, x, [(goal, math.ceil(takes / DT) + 10)])
    assert np.all((x_t - goal) * (x - goal) >= 0.0)  # on its own side of the goal, or at it
    assert x_t[-1] == goal
    assert abs(np.flatnonzero(x_t == goal)[0] * DT - takes) <= 3.0 * DT or d < 1e-6


def test_arrived_reports_the_arrival() -> None:
    state, arrivals = settled_state(LAW, 0.2), []
    assert not position_hold.arrived(position_hold.start(), 0.0)
    assert position_hold.arrived(state, 0.2)
    for _ in range(3000):
        state, _ = position_hold.step(LAW, state, 0.0, at(0.2), DT)
        arrivals.append(position_hold.arrived(state, 0.0))
    assert arrivals.index(True) == pytest.approx(2500, abs=3)  # 0.2 / 0.1 + 0.1 / 0.2 s
    assert all(arrivals[arrivals.index(True) :])


@settings(max_examples=examples(40))
@given(PLACE, st.lists(st.tuples(PLACE, st.integers(1, 400)), min_size=1, max_size=5))
def test_no_change_of_goal_bumps_the_force(x: float, goals: list[tuple[float, int]]) -> None:
    """The bound is stiffness times travel of a tick plus the ramp's share of the force."""
    state, last = position_hold.start(), 0.0
    for goal, ticks in goals:
        for _ in range(ticks):
            state, demand = position_hold.step(LAW, state, goal, at(x, 0.3), DT)
            difference = 2e4 * abs(x - state.target) + 3e3 * 0.3
            bound = 2e4 * LAW.speed * DT + difference * DT / LAW.ramp
            assert abs(demand.force - last) <= bound * (1.0 + 1e-9)
            last = demand.force


def test_a_body_is_moved_home_and_held() -> None:
    """1500 kg with its own spring of 2000 N/m, from 0.2 m: on time, overshoot < 3 mm.

    The spring also pulls home; against the hold's 2e4 N/m it changes the path by at most 10 %.
    """
    law = LAW._replace(damping=1.1e4)
    state, x, v, xs = position_hold.start(), 0.2, 0.0, []
    for tick in range(12_000):
        state, demand = position_hold.step(law, state, 0.0, at(x, v), DT)
        knock = 400.0 if 8000 <= tick < 8500 else 0.0
        v += DT * (demand.force - 2000.0 * x + knock) / 1500.0
        x += DT * v
        xs.append(x)
    path = np.array(xs)
    assert path[:8000].min() > -0.003
    assert abs(path[7999]) < 1e-3
    assert 0.001 < np.abs(path[8000:]).max() < 400.0 / 2.2e4
    assert abs(path[-1]) < 1e-3


@given(PLACE, PLACE, st.floats(-1.0, 1.0), st.integers(0, 1500))
@settings(max_examples=examples(40))
def test_a_new_zero_changes_nothing(x: float, goal: float, shift: float, ticks: int) -> None:
    """Relative to a zero that moved up, positions are lower and the force is the same."""
    state = settled_state(LAW, x)
    for _ in range(ticks):
        state, _ = position_hold.step(LAW, state, goal, at(x), DT)
    moved = position_hold.rezero(state, shift)
    _, one = position_hold.step(LAW, state, goal, at(x, 0.1), DT)
    _, other = position_hold.step(LAW, moved, goal - shift, at(x - shift, 0.1), DT)
    assert one.force == pytest.approx(other.force, abs=1e-4)  # 2e4 N/m of rounding, 1e-9 m


@pytest.mark.parametrize("bad", WEIRD)
def test_input_that_is_not_finite_gives_output_that_is_not_finite(bad: float) -> None:
    for state in (position_hold.start(), settled_state(LAW, 0.1)):
        for motion in (Estimate(bad, 0.1, 0.0), Estimate(0.1, bad, 0.0)):
            _, demand = position_hold.step(LAW, state, 0.1, motion, DT)
            assert not finite(demand.force)
        after = state
        for goal in (bad, 0.1, 0.1):  # stays so until the hold restarts
            after, demand = position_hold.step(LAW, after, goal, at(0.1), DT)
            assert not finite(demand.force)
    after, _ = position_hold.step(LAW, position_hold.start(), 0.0, at(bad), DT)
    _, demand = position_hold.step(LAW, after, 0.0, at(0.0), DT)
    assert not finite(demand.force)


@pytest.mark.parametrize("bad", [0.0, -1.0, *WEIRD])
def test_a_zero_acceleration_keeps_the_target(bad: float) -> None:
    state = settled_state(LAW, 0.1)
    for _ in range(10):
        state, demand = position_hold.step(LAW._replace(acceleration=bad), state, 0.3, at(0.1), DT)
    assert state.target == 0.1
    assert demand.force == 0.0


def test_a_restarted_law_has_no_memory() -> None:
    assert position_hold.start() == ((0.0, 0.0, 0.0), 0.0, 0.0, 0)
