"""Gating of a drive: when it rests, when it comes back, and that it never rests on a NaN."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from controllers import drive_gating
from controllers.drive_gating import Params, State

WEIRD = [math.nan, math.inf, -math.inf]
VELOCITY = st.floats(-0.5, 0.5)
CURRENT = st.floats(-20.0, 20.0)
THRESHOLD = st.sampled_from([0.0, 0.02, 0.05]) | st.floats(0.0, 0.2)


def conducts(params: Params, before: int, velocity: float, current: float, threshold: float) -> int:
    state, on = drive_gating.step(params, State(before), velocity, current, threshold)
    assert state == (on,)
    assert on in (0, 1)
    return on


@given(VELOCITY, CURRENT, THRESHOLD, st.sampled_from([0.0, 3.0]), st.sampled_from([0, 1]))
def test_it_rests_below_both_thresholds(
    velocity: float, current: float, threshold: float, most: float, before: int
) -> None:
    """|v| < threshold and |i| < its own, the latter only where there is one; without memory."""
    slow = abs(velocity) < threshold
    idle = abs(current) < most or most == 0.0
    on = conducts(Params(most, 0.0), before, velocity, current, threshold)
    assert on == (0 if slow and idle else 1)


@given(VELOCITY, CURRENT, st.sampled_from([0.0, 3.0]), st.floats(0.0, 1.0))
def test_a_threshold_of_zero_never_turns_it_off(
    velocity: float, current: float, most: float, hysteresis: float
) -> None:
    for before in (0, 1):
        for threshold in (0.0, -0.1):
            assert conducts(Params(most, hysteresis), before, velocity, current, threshold) == 1


@given(CURRENT, st.floats(0.0, 0.04))
def test_at_zero_current_threshold_the_velocity_alone_decides(current: float, v: float) -> None:
    assert conducts(Params(0.0, 0.0), 1, v, current, 0.05) == 0
    assert conducts(Params(0.0, 0.0), 1, v + 0.05, current, 0.05) == 1


@given(st.floats(0.01, 0.5), st.floats(0.0, 0.2))
def test_hysteresis_holds_a_resting_drive_off_for_longer(h: float, v: float) -> None:
    params, threshold = Params(0.0, h), 0.1
    assert conducts(params, 1, v, 0.0, threshold) == (0 if v < 0.1 else 1)
    assert conducts(params, 0, v, 0.0, threshold) == (0 if v < 0.1 + h * 0.1 else 1)
    held = Params(3.0, h)
    for i in (2.9, 3.0 + h * 2.9, 3.0 + h * 3.1):
        assert conducts(held, 1, 0.0, i, threshold) == (0 if i < 3.0 else 1)
        assert conducts(held, 0, 0.0, i, threshold) == (0 if i < 3.0 + 3.0 * h else 1)


def test_hysteresis_does_away_with_chatter() -> None:
    """A velocity that crosses the threshold with noise on it: without, many switchings."""
    rng = np.random.default_rng(4)
    velocity = np.linspace(0.0, 0.2, 4000) + 0.004 * rng.uniform(-1.0, 1.0, size=4000)

    def switchings(h: float) -> int:
        state, seen = drive_gating.start(), []
        for v in velocity.tolist():
            state, on = drive_gating.step(Params(0.0, h), state, v, 0.0, 0.1)
            seen.append(on)
        return int(np.abs(np.diff(seen)).sum())

    assert switchings(0.0) > 10
    assert switchings(0.2) == 1


def test_the_share_of_a_sine_spent_resting_is_the_arcsine() -> None:
    """|v| < threshold for 2/pi asin(threshold / amplitude) of the time."""
    v = 0.24 * np.sin(2.0 * np.pi * np.arange(10_000) / 10_000.0)
    state, on = drive_gating.start(), []
    for velocity in v.tolist():
        state, conducting = drive_gating.step(Params(3.0, 0.0), state, velocity, 0.0, 0.05)
        on.append(conducting)
    wanted = 2.0 / math.pi * math.asin(0.05 / 0.24)
    assert 1.0 - np.mean(on) == pytest.approx(wanted, abs=4e-4)  # one sample a crossing


@pytest.mark.parametrize("bad", WEIRD)
@pytest.mark.parametrize("before", [0, 1])
@pytest.mark.parametrize("most", [0.0, 3.0])
def test_what_is_no_number_keeps_it_on(bad: float, before: int, most: float) -> None:
    for hysteresis in (0.0, 0.2):
        params = Params(most, hysteresis)
        assert conducts(params, before, 0.0, 0.0, 0.05) == 0
        assert conducts(params, before, bad, 0.0, 0.05) == 1
        assert conducts(params, before, 0.0, bad, 0.05) == 1
        assert conducts(params, before, 0.0, 0.0, bad) == 1
    assert conducts(Params(math.nan, 0.0), before, 0.0, 0.0, 0.05) == 1
    assert conducts(Params(most, math.nan), 0, 0.0, 0.0, 0.05) == 1


def test_a_start_conducts() -> None:
    assert drive_gating.start() == (1,)
