"""Set-points, actual values, status and errors of the Compax3."""

from __future__ import annotations

import contextlib
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.compax3.codec import NO_ADDRESS, Kind, Object, Record, decode_record
from drivers.compax3.objects import (
    ENABLED,
    POSITION_ACTUAL,
    POWER_OFF,
    SPEED_ACTUAL,
    STATUS_WORD,
    ObjectChannel,
    Status,
    decode_actual_values,
    decode_status,
    encode_read,
    encode_set_point,
    error_name,
)
from drivers.compax3.values import NumberFormat
from drivers.errors import CodecError

SPEED = ObjectChannel(Object(1901, 1), NumberFormat.REAL48, 1.0 / math.tau)  # rad/s -> rev/s
TORQUE = ObjectChannel(Object(1902, 1), NumberFormat.INT24, -1000.0)  # N m -> -mN m
POSITION = ObjectChannel(POSITION_ACTUAL, NumberFormat.REAL48, 1.0 / math.tau)


def response(data: str) -> Record:
    return Record(Kind.RESPONSE, NO_ADDRESS, 0, bytes.fromhex(data))


def test_a_velocity_set_point_is_golden() -> None:
    record = encode_set_point(SPEED, math.tau * 2350.0, address=2)
    assert record == bytes.fromhex("C5 02 08 07 6D 01 00 09 2E 00 00 00 95 D5")


def test_a_torque_set_point_turns_its_sign_and_rounds() -> None:
    data = decode_record(encode_set_point(TORQUE, 1.0336)).data
    assert data == bytes.fromhex("07 6E 01") + (-1034).to_bytes(3, "big", signed=True)


def test_the_control_word_goes_out_as_a_word() -> None:
    channel = ObjectChannel(Object(1100, 3), NumberFormat.U16, 1.0)
    assert decode_record(encode_set_point(channel, float(ENABLED))).data == bytes.fromhex(
        "044C03 4003"
    )
    assert decode_record(encode_set_point(channel, float(POWER_OFF))).data[-2:] == b"\x00\x00"
    assert encode_set_point(channel, float(ENABLED))[0] == 0xCC


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e308, 1e9])
def test_set_points_out_of_range_are_refused(value: float) -> None:
    for channel in (SPEED, TORQUE):
        with pytest.raises(CodecError):
            encode_set_point(channel, value)


@pytest.mark.parametrize("scale", [0.0, math.nan, math.inf])
def test_a_channel_without_a_scale_is_refused(scale: float) -> None:
    with pytest.raises(CodecError, match="scale"):
        encode_set_point(ObjectChannel(Object(1, 1), NumberFormat.REAL48, scale), 1.0)


def test_one_request_reads_several_quantities() -> None:
    channels = (POSITION, ObjectChannel(SPEED_ACTUAL, NumberFormat.REAL48, 1.0 / math.tau))
    assert decode_record(encode_read(channels, address=3)).data == bytes.fromhex("02A805 02A905")
    values = decode_actual_values(channels, response("FFFFFF 800000 000001 400000"))
    assert values == pytest.approx((-0.5 * math.tau, 1.25 * math.tau))


def test_one_request_cannot_mix_format_families() -> None:
    with pytest.raises(CodecError, match="formats"):
        encode_read((POSITION, ObjectChannel(STATUS_WORD, NumberFormat.U16, 1.0)))
    with pytest.raises(CodecError, match="formats"):
        encode_read(())


def test_a_nak_has_no_values() -> None:
    with pytest.raises(CodecError, match="kind"):
        decode_actual_values((POSITION,), Record(Kind.NAK, NO_ADDRESS, 0, b"\x00\x01"))


def test_status_bits() -> None:
    assert decode_status(0x0100) == Status(1, 0, 0, 0, 0)
    assert decode_status(0x1F00) == Status(1, 1, 1, 1, 1)
    assert decode_status(0x0800) == Status(0, 0, 0, 1, 0)
    assert decode_status(0xE0FF) == Status(0, 0, 0, 0, 0)


@given(st.floats())
def test_any_number_is_a_status_or_refused(word: float) -> None:
    with contextlib.suppress(CodecError):
        assert set(decode_status(word)) <= {0, 1}


def test_errors_have_names() -> None:
    assert error_name(1) == "none"
    assert "following" in error_name(29472)
    assert "12345" in error_name(12345)


@given(st.binary(max_size=20))
def test_any_response_reads_or_is_refused(data: bytes) -> None:
    with contextlib.suppress(CodecError):
        assert all(
            map(math.isfinite, decode_actual_values((POSITION, TORQUE), response(data.hex())))
        )


@given(st.floats(-1e5, 1e5))
def test_a_set_point_reads_back(value: float) -> None:
    data = decode_record(encode_set_point(SPEED, value)).data[3:]
    (back,) = decode_actual_values((SPEED,), response(data.hex()))
    assert abs(back - value) <= math.tau * 2.0**-25 * 1.001 + abs(value) * 1e-15
