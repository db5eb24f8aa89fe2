"""The calibration block of a Digital F/T: golden requests, a block built by hand, any bytes."""

from __future__ import annotations

import contextlib
import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.checksums import modbus_crc16
from drivers.errors import CodecError
from drivers.force_torque.digital_ft_calibration import (
    BLOCK_SIZE,
    FIRST_REGISTER,
    MAX_REGISTERS,
    REGISTERS,
    calibration_scale,
    decode_calibration,
    decode_read,
    encode_read,
)

MATRIX = tuple(tuple(float(10 * row + column) + 0.5 for column in range(6)) for row in range(6))


def block(**changes: bytes) -> bytes:
    """Fields one after another, as the manual lists them."""
    fields = {
        "serial": b"FT12345\x00",
        "part": b"SI-2000-120".ljust(32, b"\x00"),
        "family": b"DFT\x00",
        "time": b"2018/05/04".ljust(20, b"\x00"),
        "matrix": b"".join(struct.pack(">6f", *row) for row in MATRIX),
        "units": bytes([2, 3]),
        "ratings": struct.pack(">6f", 2000.0, 2000.0, 4000.0, 120.0, 120.0, 120.0),
        "counts": struct.pack(">ii", 1_000_000, 500_000),
        "gains": struct.pack(">6H", *range(100, 106)),
        "offsets": struct.pack(">6H", *range(200, 206)),
        "resolution": bytes(6),
        "range": bytes(6),
        "scale": bytes(12),
        "user": bytes(48),
    }
    return b"".join((fields | changes).values())


def sealed(body: bytes) -> bytes:
    return body + modbus_crc16(body).to_bytes(2, "little")


def test_requests_are_golden() -> None:
    assert encode_read(FIRST_REGISTER, 125) == sealed(bytes.fromhex("0A 03 00E3 007D"))
    # The same request at another unit and place, as printed by another maker.
    assert encode_read(0x0300, 2, unit=1) == bytes.fromhex("01 03 03 00 00 02 C4 4F")
    for first, count in ((0, 0), (0, 126), (-1, 5), (65535, 2)):
        with pytest.raises(CodecError, match="range"):
            encode_read(first, count)


def test_the_block_is_read_in_two_parts() -> None:
    data = block()
    assert len(data) == BLOCK_SIZE == 338
    half = 2 * MAX_REGISTERS
    replies = [sealed(bytes([10, 3, len(part)]) + part) for part in (data[:half], data[half:])]
    counts = (MAX_REGISTERS, REGISTERS - MAX_REGISTERS)
    joined = b"".join(decode_read(n, r) for n, r in zip(counts, replies, strict=True))
    assert joined == data


@pytest.mark.parametrize(
    ("reply", "where"),
    [
        (b"", "length"),
        (b"\x0a\x03\x02\x00\x01\x00\x00", "check sum"),
        (sealed(b"\x0b\x03\x02\x00\x01"), "unit"),
        (sealed(b"\x0a\x83\x02"), "function"),
        (sealed(b"\x0a\x04\x02\x00\x01"), "header"),
        (sealed(b"\x0a\x03\x04\x00\x01"), "header"),
        (sealed(b"\x0a\x03\x02\x00\x01\x02"), "header"),
    ],
)
def test_another_answer_is_refused_by_name(reply: bytes, where: str) -> None:
    with pytest.raises(CodecError, match=where):
        decode_read(1, reply)


def test_every_field_is_where_it_belongs() -> None:
    read = decode_calibration(block())
    assert (read.serial, read.part, read.family, read.time) == (
        "FT12345", "SI-2000-120", "DFT", "2018/05/04",
    )  # fmt: skip
    assert read.matrix == MATRIX
    assert (read.force_unit, read.torque_unit) == (2, 3)
    assert read.ratings == (2000.0, 2000.0, 4000.0, 120.0, 120.0, 120.0)
    assert (read.per_force, read.per_torque) == (1_000_000, 500_000)
    assert read.gains == (100, 101, 102, 103, 104, 105)
    assert read.offsets == (200, 201, 202, 203, 204, 205)
    assert calibration_scale(read, "N", "N-m") == (1e-6, 2e-6)


@pytest.mark.parametrize(
    ("changes", "where"),
    [
        ({"matrix": struct.pack(">f", math.nan) + bytes(140)}, "matrix"),
        ({"ratings": struct.pack(">f", math.inf) + bytes(20)}, "matrix"),
        ({"counts": struct.pack(">ii", 0, 1)}, "counts"),
        ({"counts": struct.pack(">ii", 1, -1)}, "counts"),
        ({"user": b""}, "length"),
    ],
)
def test_an_invalid_block_is_refused(changes: dict[str, bytes], where: str) -> None:
    with pytest.raises(CodecError, match=where):
        decode_calibration(block(**changes))


@given(st.binary(max_size=400) | st.binary(min_size=BLOCK_SIZE, max_size=BLOCK_SIZE))
def test_any_block_decodes_or_is_refused(data: bytes) -> None:
    with contextlib.suppress(CodecError):
        read = decode_calibration(data)
        assert all(math.isfinite(cell) for row in read.matrix for cell in row)


@given(st.integers(1, 125), st.binary(max_size=260) | st.binary(max_size=260).map(sealed))
def test_any_reply_decodes_or_is_refused(count: int, reply: bytes) -> None:
    with contextlib.suppress(CodecError):
        assert len(decode_read(count, reply)) == 2 * count
