"""Blocks and the impedance law: bounds, NaN, and gains that never jump."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from controllers import impedance
from controllers.blocks import Ramp, clamp, finite, interpolate, ramp_start, ramp_step
from controllers.signals import Estimate, Gains

DT = 0.001
NUMBER = st.floats(-1e9, 1e9)
TARGET = st.sampled_from([0.0, 1.0, -1.0, 250.0, -2000.0, 3.7e4]) | st.floats(
    -1e5, 1e5, allow_subnormal=False
)
SWITCHES = st.lists(st.tuples(TARGET, st.integers(1, 40)), min_size=1, max_size=8)
WEIRD = [math.nan, math.inf, -math.inf]


@given(NUMBER, NUMBER, NUMBER)
def test_clamp_holds_between_its_bounds(value: float, one: float, other: float) -> None:
    low, high = min(one, other), max(one, other)
    got = clamp(value, low, high)
    assert low <= got <= high
    assert got == value or (got == low and value < low) or (got == high and value > high)


def test_clamp_lets_nan_through_and_bounds_infinity() -> None:
    assert math.isnan(clamp(math.nan, -1.0, 1.0))
    assert clamp(math.inf, -1.0, 1.0) == 1.0
    assert clamp(-math.inf, -1.0, 1.0) == -1.0


@given(st.floats())
def test_finite_agrees_with_the_library(value: float) -> None:
    assert finite(value) == math.isfinite(value)


@st.composite
def tables(draw: st.DrawFn) -> tuple[tuple[float, ...], tuple[float, ...]]:
    n = draw(st.integers(2, 6))
    steps = draw(st.lists(st.floats(0.1, 100.0), min_size=n, max_size=n))
    xs = [draw(st.floats(-100.0, 100.0))]
    for step in steps[1:]:
        xs.append(xs[-1] + step)
    ys = draw(st.lists(st.floats(-1e4, 1e4), min_size=n, max_size=n))
    return tuple(xs), tuple(ys)


@given(tables(), st.floats(-500.0, 1000.0))
def test_interpolation_stays_between_its_neighbours(
    table: tuple[tuple[float, ...], tuple[float, ...]], x: float
) -> None:
    xs, ys = table
    got = interpolate(x, xs, ys)
    if x <= xs[0]:
        assert got == ys[0]
    elif x >= xs[-1]:
        assert got == ys[-1]
    else:
        i = next(i for i in range(1, len(xs)) if xs[i] >= x)
        low, high = sorted((ys[i - 1], ys[i]))
        share = (x - xs[i - 1]) / (xs[i] - xs[i - 1])
        assert low - 1e-9 * abs(low) <= got <= high + 1e-9 * abs(high)
        assert got == pytest.approx((1 - share) * ys[i - 1] + share * ys[i], rel=1e-9, abs=1e-8)


@given(tables())
def test_interpolation_meets_its_points(
    table: tuple[tuple[float, ...], tuple[float, ...]],
) -> None:
    xs, ys = table
    for x, y in zip(xs, ys, strict=True):
        assert interpolate(x, xs, ys) == pytest.approx(y, rel=1e-12, abs=1e-9)
    assert math.isnan(interpolate(math.nan, xs, ys))
    assert interpolate(math.inf, xs, ys) == ys[-1]
    assert interpolate(-math.inf, xs, ys) == ys[0]


@given(TARGET, SWITCHES, st.floats(0.005, 0.1))
def test_a_ramp_never_jumps_and_never_overshoots(
    start: float, switches: list[tuple[float, int]], duration: float
) -> None:
    ramp = ramp_start(start)
    for target, ticks in switches:
        began = ramp.value
        slack = 1e-9 * (abs(began) + abs(target)) + 1e-12
        # a target that did not change goes on at its old rate
        bound = ramp.rate if target == ramp.target else abs(target - began) / duration
        for _ in range(ticks):
            before = ramp.value
            ramp = ramp_step(ramp, target, duration, DT)
            assert ramp.target == target
            assert abs(ramp.value - before) <= bound * DT + slack
            low, high = sorted((before, target))
            assert low - slack <= ramp.value <= high + slack


@given(TARGET, TARGET, st.floats(0.0, 0.2))
def test_a_ramp_arrives_in_its_duration(start: float, target: float, duration: float) -> None:
    ramp, ticks = ramp_start(start), 0
    while ramp.value != target:
        ramp = ramp_step(ramp, target, duration, DT)
        ticks += 1
        assert ticks < 1000
    planned = 0 if start == target else max(1, math.ceil(duration / DT - 1e-6))
    assert planned <= ticks <= planned + 1  # one more when the steps round down
    assert ramp_step(ramp, target, duration, DT) is ramp


@pytest.mark.parametrize("bad", WEIRD)
def test_a_ramp_to_no_number_never_gives_a_number(bad: float) -> None:
    ramp = ramp_start(1.0)
    for _ in range(10):
        ramp = ramp_step(ramp, bad, 0.01, DT)
        assert not finite(ramp.value)


def test_a_ramp_from_nan_stays_nan() -> None:
    ramp = Ramp(math.nan, math.nan, 0.0)
    for _ in range(10):
        ramp = ramp_step(ramp, 5.0, 0.01, DT)
        assert math.isnan(ramp.value)


# --- the law

LAW = impedance.Params(ramp=0.02)


def settled(gains: Gains) -> impedance.State:
    state = impedance.start()
    for _ in range(30):
        state, _ = impedance.step(LAW, state, gains, Estimate(0.0, 0.0, 0.0), DT)
    return state


@given(TARGET, TARGET, st.floats(-2.0, 2.0), st.floats(-0.5, 0.5))
def test_the_force_is_kp_v_plus_ki_x(kp: float, ki: float, v: float, x: float) -> None:
    _, demand = impedance.step(LAW, settled(Gains(kp, ki)), Gains(kp, ki), Estimate(x, v, 9.9), DT)
    assert demand == (kp, ki, kp * v + ki * x)


def test_the_sign_of_the_recorded_data() -> None:
    """Kp < 0 takes energy out of the body; Ki > 0 pushes it away from rest."""
    damping = settled(Gains(-2000.0, 0.0))
    for v in (-0.4, 0.4):
        _, demand = impedance.step(LAW, damping, Gains(-2000.0, 0.0), Estimate(0.1, v, 0.0), DT)
        assert demand.force * v == pytest.approx(-320.0)
    spring = settled(Gains(0.0, 3000.0))
    for x in (-0.1, 0.1):
        _, demand = impedance.step(LAW, spring, Gains(0.0, 3000.0), Estimate(x, 0.0, 0.0), DT)
        assert demand.force * x == pytest.approx(30.0)


@pytest.mark.parametrize("v", [0.7, -0.7])
def test_the_first_force_is_within_one_step_of_zero(v: float) -> None:
    gains = Gains(-2000.0, 5000.0)
    _, demand = impedance.step(LAW, impedance.start(), gains, Estimate(0.2, v, 0.0), DT)
    assert demand.kp == pytest.approx(-2000.0 * DT / LAW.ramp)
    assert demand.ki == pytest.approx(5000.0 * DT / LAW.ramp)


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.tuples(TARGET, TARGET, st.integers(1, 30)), min_size=2, max_size=10),
    st.floats(0.0, 1.0),
    st.floats(0.0, 0.3),
)
def test_no_sequence_of_gain_switches_bumps_the_force(
    switches: list[tuple[float, float, int]], v: float, x: float
) -> None:
    """At constant motion the force moves by at most rate * dt a tick, whenever a switch comes."""
    state, last = impedance.start(), 0.0
    steps = LAW.ramp / DT
    reach = [0.0, 0.0]  # widest way any ramp so far could have to go
    for kp, ki, ticks in switches:
        for i, (ramp, new) in enumerate(((state.kp, kp), (state.ki, ki))):
            reach[i] = max(reach[i], abs(new - ramp.value))
        for _ in range(ticks):
            state, demand = impedance.step(LAW, state, Gains(kp, ki), Estimate(x, v, 0.0), DT)
            most = (reach[0] * v + reach[1] * x) / steps
            size = abs(last) + abs(demand.force) + (abs(kp) + abs(ki)) * (v + x)
            assert abs(demand.force - last) <= most + 1e-9 * size + 1e-9
            last = demand.force
    for _ in range(int(steps) + 1):
        state, demand = impedance.step(LAW, state, Gains(kp, ki), Estimate(x, v, 0.0), DT)
    assert demand[:2] == (kp, ki)


@pytest.mark.parametrize("bad", WEIRD)
@pytest.mark.parametrize("field", range(2))
def test_no_number_in_gives_no_number_out(bad: float, field: int) -> None:
    gains = Gains(-2000.0, 500.0)
    motion = [0.1, 0.2]
    motion[field] = bad
    _, demand = impedance.step(LAW, settled(gains), gains, Estimate(*motion, 0.0), DT)
    assert not finite(demand.force)
    odd = [-2000.0, 500.0]
    odd[field] = bad
    _, demand = impedance.step(LAW, settled(gains), Gains(*odd), Estimate(0.1, 0.2, 0.0), DT)
    assert not finite(demand.force)
