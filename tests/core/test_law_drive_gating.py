"""Gating of a drive: when it rests, when it returns, and that NaN keeps it on."""

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
def test_the_drive_rests_below_both_thresholds(
    velocity: float, current: float, threshold: float, current_limit: float, before: int
) -> None:
    """|v| and |i| below their thresholds, a current threshold of 0 being unused; no memory."""
    slow = abs(velocity) < threshold
    idle = abs(current) < current_limit or current_limit == 0.0
    on = conducts(Params(current_limit, 0.0), before, velocity, current, threshold)
    assert on == (0 if slow and idle else 1)


@given(VELOCITY, CURRENT, st.sampled_from([0.0, 3.0]), st.floats(0.0, 1.0))
def test_a_velocity_threshold_of_zero_never_rests(
    velocity: float, current: float, current_limit: float, hysteresis: float
) -> None:
    for before in (0, 1):
        for threshold in (0.0, -0.1):
            assert (
                conducts(Params(current_limit, hysteresis), before, velocity, current, threshold)
                == 1
            )


@given(CURRENT, st.floats(0.0, 0.04))
def test_at_zero_current_threshold_the_velocity_alone_decides(current: float, v: float) -> None:
    assert conducts(Params(0.0, 0.0), 1, v, current, 0.05) == 0
    assert conducts(Params(0.0, 0.0), 1, v + 0.05, current, 0.05) == 1


@given(st.floats(0.01, 0.5), st.floats(0.0, 0.2))
def test_hysteresis_keeps_a_resting_drive_off_longer(h: float, v: float) -> None:
    params, threshold = Params(0.0, h), 0.1
    assert conducts(params, 1, v, 0.0, threshold) == (0 if v < 0.1 else 1)
    assert conducts(params, 0, v, 0.0, threshold) == (0 if v < 0.1 + h * 0.1 else 1)
    gate_params = Params(3.0, h)
    for i in (2.9, 3.0 + h * 2.9, 3.0 + h * 3.1):
        assert conducts(gate_params, 1, 0.0, i, threshold) == (0 if i < 3.0 else 1)
        assert conducts(gate_params, 0, 0.0, i, threshold) == (0 if i < 3.0 + 3.0 * h else 1)


def test_hysteresis_removes_chatter() -> None:
    """A noisy velocity that crosses the threshold switches often without hysteresis."""
    rng = np.random.default_rng(4)
    velocity = np.linspace(0.0, 0.2, 4000) + 0.004 * rng.uniform(-1.0, 1.0, size=4000)

    def switchings(h: float) -> int:
        state, switched = drive_gating.start(), []
        for v in velocity.tolist():
            state, on = drive_gating.step(Params(0.0, h), state, v, 0.0, 0.1)
            switched.append(on)
        return int(np.abs(np.diff(switched)).sum())

    assert switchings(0.0) > 10
    assert switchings(0.2) == 1


def test_the_resting_share_of_a_sine_is_the_arcsine() -> None:
    """|v| < threshold for 2/pi asin(threshold / amplitude) of the time."""
    v = 0.24 * np.sin(2.0 * np.pi * np.arange(10_000) / 10_000.0)
    state, on = drive_gating.start(), []
    for velocity in v.tolist():
        state, conducting = drive_gating.step(Params(3.0, 0.0), state, velocity, 0.0, 0.05)
        on.append(conducting)
    expected = 2.0 / math.pi * math.asin(0.05 / 0.24)
    assert 1.0 - np.mean(on) == pytest.approx(expected, abs=4e-4)  # one sample per crossing


@pytest.mark.parametrize("bad", WEIRD)
@pytest.mark.parametrize("before", [0, 1])
@pytest.mark.parametrize("current_limit", [0.0, 3.0])
def test_a_value_that_is_not_finite_keeps_the_drive_on(
    bad: float, before: int, current_limit: float
) -> None:
    for hysteresis in (0.0, 0.2):
        params = Params(current_limit, hysteresis)
        assert conducts(params, before, 0.0, 0.0, 0.05) == 0
        assert conducts(params, before, bad, 0.0, 0.05) == 1
        assert conducts(params, before, 0.0, bad, 0.05) == 1
        assert conducts(params, before, 0.0, 0.0, bad) == 1
    assert conducts(Params(math.nan, 0.0), before, 0.0, 0.0, 0.05) == 1
    assert conducts(Params(current_limit, math.nan), 0, 0.0, 0.0, 0.05) == 1


def test_a_start_conducts() -> None:
    assert drive_gating.start() == (1,)
