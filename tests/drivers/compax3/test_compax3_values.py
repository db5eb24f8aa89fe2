"""Number formats of the Compax3: closed form, ends of range, any bytes, any float."""

from __future__ import annotations

import contextlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.compax3.values import WIDTH, NumberFormat, decode_value, encode_value, is_plc
from drivers.errors import CodecError

FORMS = st.sampled_from(list(NumberFormat))


@pytest.mark.parametrize(
    ("form", "value", "data"),
    [
        (NumberFormat.REAL48, 2350.0, "00 09 2E 00 00 00"),  # the manual's
        (NumberFormat.REAL48, -467 / 2**24, "FF FF FF FF FE 2D"),  # the manual's
        (NumberFormat.REAL48, 450.5, "00 01 C2 80 00 00"),
        (NumberFormat.REAL48, -1.0, "FF FF FF 00 00 00"),
        (NumberFormat.REAL48, -8388608.0, "80 00 00 00 00 00"),
        (NumberFormat.INT24, -1.0, "FF FF FF"),
        (NumberFormat.INT24, 8388607.0, "7F FF FF"),
        (NumberFormat.DINT48, -(2.0**47), "80 00 00 00 00 00"),
        (NumberFormat.U16, 16387.0, "40 03"),
        (NumberFormat.U32, 4294967295.0, "FF FF FF FF"),
        (NumberFormat.F32, 1.5, "3F C0 00 00"),
    ],
)
def test_known_numbers(form: NumberFormat, value: float, data: str) -> None:
    assert encode_value(form, value) == bytes.fromhex(data)
    assert decode_value(form, bytes.fromhex(data)) == value


@pytest.mark.parametrize(
    ("form", "value"),
    [
        *(
            (form, bad)
            for form in NumberFormat
            for bad in (math.nan, math.inf, -math.inf, 1e300, -1e308)
        ),
        (NumberFormat.REAL48, 8388608.0),
        (NumberFormat.INT24, 8388608.0),
        (NumberFormat.INT24, 0.5),
        (NumberFormat.DINT48, 2.0**47),
        (NumberFormat.U16, -1.0),
        (NumberFormat.U16, 65536.0),
        (NumberFormat.U32, 2.0**32),
        (NumberFormat.F32, 3.5e38),
    ],
)
def test_values_out_of_range_are_refused(form: NumberFormat, value: float) -> None:
    with pytest.raises(CodecError, match=form.name):
        encode_value(form, value)


@pytest.mark.parametrize("data", ["7F C0 00 00", "7F 80 00 00", "FF 80 00 00"])
def test_nan_and_infinity_are_refused(data: str) -> None:
    with pytest.raises(CodecError, match="finite"):
        decode_value(NumberFormat.F32, bytes.fromhex(data))


def test_only_plc_formats_ask_for_the_plc_bit() -> None:
    assert {form for form in NumberFormat if is_plc(form)} == {
        NumberFormat.U16,
        NumberFormat.U32,
        NumberFormat.F32,
    }


@given(FORMS, st.binary(max_size=8))
def test_any_bytes_decode_or_are_refused(form: NumberFormat, data: bytes) -> None:
    with contextlib.suppress(CodecError):
        value = decode_value(form, data)
        assert math.isfinite(value)
        assert decode_value(form, encode_value(form, value)) == value
    if len(data) != WIDTH[form]:
        with pytest.raises(CodecError, match="bytes"):
            decode_value(form, data)


@given(FORMS, st.floats())
def test_any_float_encodes_or_is_refused(form: NumberFormat, value: float) -> None:
    with contextlib.suppress(CodecError):
        assert len(encode_value(form, value)) == WIDTH[form]


@given(st.floats(-8388608.0, 8388607.5))
def test_real48_is_right_to_half_a_step(value: float) -> None:
    assert (
        abs(decode_value(NumberFormat.REAL48, encode_value(NumberFormat.REAL48, value)) - value)
        <= 2.0**-25
    )
