"""Current and position between our units and a drive's, with the traps on record."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.cia402 import scaling
from drivers.cia402.scaling import (
    LimitFlag,
    ScalingError,
    amc_current,
    current_command,
    current_feedback,
    kt_of_drive,
    position_command,
    position_feedback,
    position_scale,
    rated_current,
    rated_torque_current,
    unwrap_counts,
)


def test_an_amc_drive_of_100_a() -> None:
    scale = amc_current(1000, 40.0)
    assert 1 / scale.raw_per_ampere == pytest.approx(3.05e-3, rel=1e-3)  # DC2
    assert scale.ampere_per_raw == pytest.approx(12.2e-3, rel=1e-3)  # DC1
    assert current_command(scale, 10.0) == (3277, 0)
    assert current_command(scale, -10.0) == (-3277, 0)
    assert current_feedback(scale, 8192) == 100.0


def test_command_and_feedback_of_an_amc_drive_differ_by_four() -> None:
    """Reading the command's own number as a feedback shows four times the current."""
    scale = amc_current(400, 40.0)
    raw = current_command(scale, 5.0).value
    assert current_feedback(scale, raw) == pytest.approx(20.0, rel=1e-3)
    assert current_feedback(scale, round(raw / 4)) == pytest.approx(5.0, rel=1e-3)


def test_kp_is_in_tenths_of_an_ampere() -> None:
    assert current_command(amc_current(400, 40.0), 20.0) == (16384, 0)
    assert current_command(amc_current(400, 40.0), 40.0) == (32767, LimitFlag.SATURATED)
    assert current_command(amc_current(400, 30.0), 40.0) == (24576, LimitFlag.SATURATED)


def test_per_mille_of_rated_torque_and_of_rated_current() -> None:
    by_torque = rated_torque_current(12000, 6.0, 40.0)  # 12 N m at 2 A
    by_current = rated_current(2000, 40.0)
    assert current_command(by_torque, 1.0) == current_command(by_current, 1.0) == (500, 0)
    assert current_feedback(by_torque, 500) == current_feedback(by_current, 500) == 1.0
    assert current_command(by_torque, 3.0) == (1500, 0)
    assert kt_of_drive(12000, 2000) == 6.0


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_nan_and_infinity_give_zero_current(bad: float) -> None:
    assert current_command(amc_current(400, 40.0), bad) == (0, LimitFlag.NOT_FINITE)
    assert position_command(position_scale(-2.0, 7, -9, 9), bad) == (7, LimitFlag.NOT_FINITE)


def test_invalid_scales_are_refused_by_name() -> None:
    for kp in (0, -1):
        with pytest.raises(ScalingError, match="20D8:0C"):
            amc_current(kp, 40.0)
    for limit in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(ScalingError, match="current limit, A"):
            amc_current(400, limit)
    with pytest.raises(ScalingError, match="below one step"):
        amc_current(1000, 0.001)
    with pytest.raises(ScalingError, match="0x6076"):
        rated_torque_current(0, 6.0, 40.0)
    for kt in (0.0, -1.0, math.nan):
        with pytest.raises(ScalingError, match="Kt"):
            rated_torque_current(12000, kt, 40.0)
    with pytest.raises(ScalingError, match="0x6075"):
        rated_current(0, 40.0)
    with pytest.raises(ScalingError, match="0x6075"):
        kt_of_drive(12000, 0)
    for counts in (0.0, math.nan, math.inf):
        with pytest.raises(ScalingError, match="counts per unit"):
            position_scale(counts, 0, -1, 1)
    for low, high in ((1, 0), (-(2**31), 0), (0, 2**31)):
        with pytest.raises(ScalingError, match="0x607D"):
            position_scale(1.0, 0, low, high)


@given(st.integers(1, 0xFFFF), st.floats(0.5, 100.0), st.floats())
def test_a_command_stays_within_its_limit_and_its_sign(
    kp: int, limit: float, current: float
) -> None:
    scale = amc_current(kp, limit)
    value, flag = current_command(scale, current)
    assert -scale.raw_limit <= value <= scale.raw_limit <= 0x7FFF
    assert abs(value) / scale.raw_per_ampere <= limit * (1 + 1e-12)
    if not math.isfinite(current):
        assert (value, flag) == (0, LimitFlag.NOT_FINITE)
    elif flag == 0:
        assert abs(value - current * scale.raw_per_ampere) <= 0.5
    else:
        assert flag == LimitFlag.SATURATED
        assert value == math.copysign(scale.raw_limit, current)


def test_positions() -> None:
    scale = position_scale(-2000.0, 500, -10_000, 10_000)
    assert position_command(scale, 1.0) == (-1500, 0)
    assert position_feedback(scale, -1500) == 1.0
    assert position_command(scale, 99.0) == (-10_000, LimitFlag.SATURATED)
    assert position_command(scale, -1e308) == (10_000, LimitFlag.SATURATED)


@given(st.integers(-(2**31), 2**31 - 1), st.lists(st.integers(-(2**31) + 1, 2**31 - 1)))
def test_counts_go_on_where_the_register_wraps(begin: int, steps: list[int]) -> None:
    true = seen = begin
    for way in steps:
        true += way
        seen = unwrap_counts(seen, (true + 2**31) % 2**32 - 2**31)
        assert seen == true


def test_the_flags_are_of_one_bit_each() -> None:
    assert [flag.value for flag in scaling.LimitFlag] == [1, 2]
