"""The limiter of an axis: granted force, its rate, and trips."""

from __future__ import annotations

import math

import pytest
from core_checks import BOUNDS, LIMITED, MODES, check_limits
from hypothesis import given
from hypothesis import strategies as st

from controllers.signals import AxisSense, Estimate
from rig.realtime import limits
from rig.realtime.limits import AxisLimits, AxisState
from rig.realtime.reasons import Reason
from rig.realtime.safety import RUN, STOP_1, STOP_2

DT = 0.001
WAVEBOT = AxisLimits(
    position_warn=0.30,
    position_stop=0.35,
    velocity_stop=1.5,
    current_peak=40.0,
    current_rms=20.0,
    current_rms_time=10.0,
    force_slew=200_000.0,
    encoder_age_stop=0.02,
    encoder_jump_stop=0.05,
    drive_age_stop=0.1,
    current_difference_stop=2.0,
    current_ticks_stop=200,
    newtons_per_ampere=76.975,
)
STEP = WAVEBOT.force_slew * DT
DEMAND = st.floats(-1e5, 1e5)


def test_every_trip_and_every_grant_is_as_expected() -> None:
    check_limits(limits)


def test_limits_have_no_default() -> None:
    assert AxisLimits._field_defaults == {}
    assert set(BOUNDS) == set(AxisLimits._fields)


@given(st.lists(st.tuples(DEMAND, st.sampled_from([RUN, STOP_1, STOP_2])), max_size=60))
def test_any_demand_keeps_the_force_within_its_bounds(demands: list[tuple[float, int]]) -> None:
    state, last = limits.start(), 0.0
    for demand, mode in demands:
        state, command = limits.grant(WAVEBOT, state, demand, 1, mode, DT)
        assert abs(command.force - last) <= STEP * (1 + 1e-12)
        assert abs(command.current) <= WAVEBOT.current_peak * (1 + 1e-12)
        assert command.force == pytest.approx(command.current * WAVEBOT.newtons_per_ampere)
        assert command.enable == 1
        if command.limited == 0:
            assert command.force == demand
        else:
            assert command.force != demand
        last = command.force


@given(st.lists(st.one_of(st.floats(), DEMAND), min_size=1, max_size=30))
def test_any_demand_gives_a_finite_force(demands: list[float]) -> None:
    state = limits.start()
    for demand in demands:
        state, command = limits.grant(WAVEBOT, state, demand, 1, RUN, DT)
        assert math.isfinite(command.force)
        assert math.isfinite(command.current)
        assert math.isfinite(state.mean_square)
        if not math.isfinite(demand):
            assert command == (0.0, 0.0, 1, LIMITED["NOT_FINITE"])


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_a_demand_that_is_not_finite_trips_in_the_next_tick(bad: float) -> None:
    state = AxisState(500.0, 3.0, 0)
    state, command = limits.grant(WAVEBOT, state, bad, 1, RUN, DT)
    assert command.force == 0.0
    sense, still = AxisSense(0, 0.0, 0.0, 1, 0, 0.0), Estimate(0.0, 0.0, 0.0)
    assert checked(state, sense, still) == Reason.NOT_FINITE
    state, _ = limits.grant(WAVEBOT, state, 0.0, 1, RUN, DT)
    assert checked(state, sense, still) == Reason.NONE


def checked(state: AxisState, sense: AxisSense, motion: Estimate) -> int:
    return limits.check_axis(WAVEBOT, state, 0, sense, motion.position, motion, RUN)


def constant(demand: float, seconds: float) -> list[tuple[float, int]]:
    """Return current and flags, tick by tick, for a constant demand."""
    state, out = limits.start(), []
    for _ in range(round(seconds / DT)):
        state, command = limits.grant(WAVEBOT, state, demand, 1, RUN, DT)
        out.append((command.current, command.limited))
    return out


def test_peak_current_folds_back_to_the_continuous_one_in_time_and_without_a_jump() -> None:
    """40 A uses up a mean square of 20 A^2 over 10 s in 10 ln(4/3) = 2.877 s."""
    got = constant(1e6, 6.0)
    peak, flags = LIMITED["CURRENT_PEAK"], {limited for _, limited in got}
    rms, slew = LIMITED["CURRENT_RMS"], LIMITED["SLEW"]
    assert flags == {peak | slew, peak, rms | slew, rms}
    first = next(i for i, (_, limited) in enumerate(got) if limited & rms)
    assert first * DT == pytest.approx(10.0 * math.log(4.0 / 3.0), abs=0.02)
    for i in range(1, len(got)):
        change = abs(got[i][0] - got[i - 1][0]) * WAVEBOT.newtons_per_ampere
        assert change <= STEP * (1 + 1e-9)
    assert all(current == pytest.approx(20.0) for current, _ in got[first + 20 :])


def test_the_continuous_current_is_never_folded_back() -> None:
    demand = 19.99 * WAVEBOT.newtons_per_ampere
    assert {limited for _, limited in constant(demand, 30.0)[20:]} == {0}


def test_the_mean_square_over_any_long_time_stays_at_the_continuous_current() -> None:
    """A sinusoidal demand of 60 A: peaks limited to 40 A, mean square to about 20 A."""
    state, squares, n = limits.start(), 0.0, 60_000
    for k in range(2 * n):
        demand = 60.0 * WAVEBOT.newtons_per_ampere * math.sin(2.0 * math.pi * 0.5 * k * DT)
        state, command = limits.grant(WAVEBOT, state, demand, 1, RUN, DT)
        if k >= n:
            squares += command.current * command.current
    assert math.sqrt(squares / n) < 1.02 * WAVEBOT.current_rms
    assert math.sqrt(squares / n) > 0.8 * WAVEBOT.current_rms


@pytest.mark.parametrize("mode", [m for name, m in MODES.items() if name in ("OFF", "STOP_0")])
def test_power_off_takes_the_force_away_at_once_and_lets_the_motor_cool(mode: int) -> None:
    state = AxisState(3000.0, 400.0, 0)
    for k in range(1000):
        state, command = limits.grant(WAVEBOT, state, 3000.0, 1, mode, DT)
        assert command == (0.0, 0.0, 0, LIMITED["MODE"]), k
    assert state.mean_square == pytest.approx(400.0 * math.exp(-0.1), rel=1e-3)
