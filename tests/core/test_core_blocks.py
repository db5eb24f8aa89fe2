"""Building blocks: bounds, NaN, tables, and ramps that never jump."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers.blocks import Ramp, clamp, finite, interpolate, ramp_start, ramp_step

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


def test_clamp_passes_nan_and_bounds_infinity() -> None:
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
        slack = 1e-15 * (abs(low) + abs(high))  # the difference is rounded before the addition
        assert low - slack <= got <= high + slack
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
        # an unchanged target keeps its old rate
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
def test_a_ramp_to_a_value_that_is_not_finite_is_not_finite(bad: float) -> None:
    ramp = ramp_start(1.0)
    for _ in range(10):
        ramp = ramp_step(ramp, bad, 0.01, DT)
        assert not finite(ramp.value)


def test_a_ramp_from_nan_stays_nan() -> None:
    ramp = Ramp(math.nan, math.nan, 0.0)
    for _ in range(10):
        ramp = ramp_step(ramp, 5.0, 0.01, DT)
        assert math.isnan(ramp.value)
