"""Checksums against polynomial division, and against published test vectors.

The oracle divides one big integer by another, bit by bit; it shares no line with the code.
"""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers import checksums


def remainder(dividend: int, divisor: int) -> int:
    """Return the remainder of a division of polynomials over GF(2)."""
    while dividend.bit_length() >= divisor.bit_length():
        dividend ^= divisor << dividend.bit_length() - divisor.bit_length()
    return dividend


def mirrored(number: int, bits: int) -> int:
    return int(f"{number:0{bits}b}"[::-1], 2)


@given(st.binary(max_size=80), st.integers(0, 0xFFFF))
def test_crc16_is_a_division(data: bytes, start: int) -> None:
    message = int.from_bytes(data, "big") << 16
    assert checksums.crc16(data, start) == remainder(message ^ start << 8 * len(data), 0x11021)


def test_crc16_of_the_catalogue() -> None:
    assert checksums.crc16(b"123456789") == 0x29B1  # CRC-16/IBM-3740
    assert checksums.crc16(b"123456789", 0) == 0x31C3  # CRC-16/XMODEM


@given(st.binary(max_size=80))
def test_crc16_of_data_and_its_crc_is_zero(data: bytes) -> None:
    assert checksums.crc16(data + checksums.crc16(data).to_bytes(2, "big")) == 0


@given(st.binary(max_size=260))
def test_compax3_is_a_division_of_the_bare_message(data: bytes) -> None:
    assert checksums.compax3_crc16(data) == remainder(int.from_bytes(data, "big"), 0x11021)


@given(st.binary(max_size=260))
def test_compax3_is_the_loop_of_the_manual(data: bytes) -> None:
    """The manual's table holds the remainder of each byte shifted by 16."""
    table = [remainder(byte << 16, 0x11021) for byte in range(256)]
    crc = 0
    for byte in data:
        crc = table[crc >> 8] ^ (crc << 8 & 0xFFFF) ^ byte
    assert checksums.compax3_crc16(data) == crc


@pytest.mark.parametrize(
    "record",
    [
        "A5 03 02 02 A8 05 E1 46",
        "05 05 FF FF FF FF FE 2D 07 B4",
        "C5 02 08 07 6D 01 00 09 2E 00 00 00 95 D5",
        "06 01 00 00 BA 87",
    ],
)
def test_compax3_gives_the_sums_printed_in_the_manual(record: str) -> None:
    data = bytes.fromhex(record)
    assert checksums.compax3_crc16(data[:-2]) == int.from_bytes(data[-2:], "big")


def test_compax3_is_not_xmodem_and_leaves_no_zero() -> None:
    data = bytes.fromhex("06 01 00 00 BA 87")
    assert checksums.crc16(data[:-2], 0) != 0xBA87
    assert checksums.compax3_crc16(data) != 0


@given(st.binary(max_size=80))
def test_modbus_is_a_reflected_division(data: bytes) -> None:
    message = int.from_bytes(bytes(mirrored(byte, 8) for byte in data), "big") << 16
    expected = remainder(message ^ 0xFFFF << 8 * len(data), 0x18005)
    assert checksums.modbus_crc16(data) == mirrored(expected, 16)


def test_modbus_of_the_catalogue_and_of_a_manufacturer() -> None:
    assert checksums.modbus_crc16(b"123456789") == 0x4B37
    assert checksums.modbus_crc16(bytes.fromhex("01 03 03 00 00 02")) == 0x4FC4  # sent C4 4F


@given(st.integers(0, 0xFFFFFF))
def test_ssi6_is_a_division(word: int) -> None:
    assert checksums.ssi6_crc8(word) == remainder(word << 8, 0x197)


@given(st.integers(0, 0xFFFFFF), st.integers(0, 23), st.integers(0, 23))
def test_ssi6_detects_every_one_and_two_flipped_bits(word: int, a: int, b: int) -> None:
    flipped = word ^ 1 << a ^ (1 << b if a != b else 0)
    assert checksums.ssi6_crc8(flipped) != checksums.ssi6_crc8(word)
