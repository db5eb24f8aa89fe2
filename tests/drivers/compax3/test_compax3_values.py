"""Number formats of the Compax3: closed form, ends of range, any bytes, any float."""

from __future__ import annotations

import contextlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.compax3.values import WIDTH, Form, decode_value, encode_value, is_plc
from drivers.errors import CodecError

FORMS = st.sampled_from(list(Form))


@pytest.mark.parametrize(
    ("form", "value", "data"),
    [
        (Form.REAL48, 2350.0, "00 09 2E 00 00 00"),  # the manual's
        (Form.REAL48, -467 / 2**24, "FF FF FF FF FE 2D"),  # the manual's
        (Form.REAL48, 450.5, "00 01 C2 80 00 00"),
        (Form.REAL48, -1.0, "FF FF FF 00 00 00"),
        (Form.REAL48, -8388608.0, "80 00 00 00 00 00"),
        (Form.INT24, -1.0, "FF FF FF"),
        (Form.INT24, 8388607.0, "7F FF FF"),
        (Form.DINT48, -(2.0**47), "80 00 00 00 00 00"),
        (Form.U16, 16387.0, "40 03"),
        (Form.U32, 4294967295.0, "FF FF FF FF"),
        (Form.F32, 1.5, "3F C0 00 00"),
    ],
)
def test_known_numbers(form: Form, value: float, data: str) -> None:
    assert encode_value(form, value) == bytes.fromhex(data)
    assert decode_value(form, bytes.fromhex(data)) == value


@pytest.mark.parametrize(
    ("form", "value"),
    [
        *((form, bad) for form in Form for bad in (math.nan, math.inf, -math.inf, 1e300, -1e308)),
        (Form.REAL48, 8388608.0),
        (Form.INT24, 8388608.0),
        (Form.INT24, 0.5),
        (Form.DINT48, 2.0**47),
        (Form.U16, -1.0),
        (Form.U16, 65536.0),
        (Form.U32, 2.0**32),
        (Form.F32, 3.5e38),
    ],
)
def test_what_does_not_fit_is_refused(form: Form, value: float) -> None:
    with pytest.raises(CodecError, match=form.name):
        encode_value(form, value)


@pytest.mark.parametrize("data", ["7F C0 00 00", "7F 80 00 00", "FF 80 00 00"])
def test_a_float_that_is_no_number_is_refused(data: str) -> None:
    with pytest.raises(CodecError, match="finite"):
        decode_value(Form.F32, bytes.fromhex(data))


def test_only_plc_formats_ask_for_the_plc_bit() -> None:
    assert {form for form in Form if is_plc(form)} == {Form.U16, Form.U32, Form.F32}


@given(FORMS, st.binary(max_size=8))
def test_any_bytes_decode_or_are_refused(form: Form, data: bytes) -> None:
    with contextlib.suppress(CodecError):
        value = decode_value(form, data)
        assert math.isfinite(value)
        assert decode_value(form, encode_value(form, value)) == value
    if len(data) != WIDTH[form]:
        with pytest.raises(CodecError, match="bytes"):
            decode_value(form, data)


@given(FORMS, st.floats())
def test_any_float_encodes_or_is_refused(form: Form, value: float) -> None:
    with contextlib.suppress(CodecError):
        assert len(encode_value(form, value)) == WIDTH[form]


@given(st.floats(-8388608.0, 8388607.5))
def test_real48_is_right_to_half_a_step(value: float) -> None:
    assert abs(decode_value(Form.REAL48, encode_value(Form.REAL48, value)) - value) <= 2.0**-25
