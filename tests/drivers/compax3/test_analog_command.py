"""The +-10 V command: closed form, clamp with its flag, inverse, and no voltage for NaN."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.compax3.analog_command import Params, make_params, rest_voltage, to_command, to_volts
from drivers.errors import CodecError

# 37.5 rev/s of the motor at 10 V, with an offset as one measures it.
SPEED = make_params(0.013, 10.0 / (math.tau * 37.5), -9.5, 9.5)


def test_closed_form() -> None:
    assert to_volts(SPEED, 0.0) == (0.013, 0)
    volts, flag = to_volts(SPEED, math.tau * 3.75)
    assert volts == pytest.approx(1.013)
    assert flag == 0


def test_the_clamp_is_flagged_on_its_side() -> None:
    assert to_volts(SPEED, 1e4) == (9.5, 1)
    assert to_volts(SPEED, -1e4) == (-9.5, -1)
    turned = make_params(0.0, -0.5, -5.0, 5.0)
    assert to_volts(turned, 11.0) == (-5.0, -1)
    assert to_volts(turned, 10.0) == (-5.0, 0)
    assert to_volts(turned, -10.0) == (5.0, 0)
    assert to_volts(SPEED, 1e308) == (9.5, 1)


@pytest.mark.parametrize("command", [math.nan, math.inf, -math.inf])
def test_nan_and_infinity_give_no_voltage(command: float) -> None:
    with pytest.raises(CodecError, match="finite"):
        to_volts(SPEED, command)
    with pytest.raises(CodecError, match="finite"):
        to_command(SPEED, command)


def test_one_volt_per_unit_is_a_gain_like_any() -> None:
    assert to_volts(make_params(0.0, 1.0, -10.0, 10.0), 3.0) == (3.0, 0)


def test_rest_voltage_is_a_zero_command() -> None:
    assert rest_voltage(SPEED) == 0.013
    assert to_command(SPEED, rest_voltage(SPEED)) == 0.0


@pytest.mark.parametrize(
    ("numbers", "where"),
    [
        ((0.0, 0.0, -10.0, 10.0), "gain"),
        ((0.0, 1e-320, -10.0, 10.0), "gain"),
        ((math.nan, 1.0, -10.0, 10.0), "calibration"),
        ((0.0, 1.0, -math.inf, 10.0), "calibration"),
        ((0.0, 1.0, 10.0, -10.0), "offset"),
        ((10.5, 1.0, -10.0, 10.0), "offset"),
        ((10.0, 1.0, -10.0, 10.0), "offset"),
        ((-10.0, 1.0, -10.0, 10.0), "offset"),
    ],
)
def test_a_calibration_that_cannot_rest_is_refused(
    numbers: tuple[float, float, float, float], where: str
) -> None:
    with pytest.raises(CodecError, match=where):
        make_params(*numbers)


gains = st.floats(1e-3, 1e3).flatmap(lambda g: st.sampled_from([g, -g]))


@given(st.floats(-1.0, 1.0), gains, st.floats(allow_nan=False, allow_infinity=False))
def test_every_command_ends_in_the_clamp(offset: float, gain: float, command: float) -> None:
    params = make_params(offset, gain, -10.0, 10.0)
    volts, flag = to_volts(params, command)
    assert -10.0 <= volts <= 10.0
    if flag:
        assert volts == 10.0 * flag
    else:
        assert to_command(params, volts) == pytest.approx(command, rel=1e-9, abs=1e-12 / abs(gain))


@given(st.floats(), st.floats(), st.floats(), st.floats())
def test_any_numbers_are_a_calibration_or_refused(a: float, b: float, c: float, d: float) -> None:
    try:
        params = make_params(a, b, c, d)
    except CodecError:
        return
    assert params == Params(a, b, c, d)
    assert to_volts(params, 0.0) == (a, 0)
