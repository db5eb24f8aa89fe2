"""Compax3 binary records: the manual's bytes, the limits, and any bytes at all."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.checksums import compax3_crc16
from drivers.compax3.codec import (
    NO_ADDRESS,
    Kind,
    Object,
    Record,
    allows_size,
    decode_record,
    encode_record,
    error_number,
    read_request,
    write_request,
)
from drivers.compax3.values import NumberFormat, decode_value, decode_values, encode_value
from drivers.errors import CodecError

# Printed in every manual of the series, 192-120100 page 157 among them.
READ_680_5 = bytes.fromhex("A5 03 02 02 A8 05 E1 46")
RESPONSE = bytes.fromhex("05 05 FF FF FF FF FE 2D 07 B4")
WRITE_1901_1 = bytes.fromhex("C5 02 08 07 6D 01 00 09 2E 00 00 00 95 D5")
ACK = bytes.fromhex("06 01 00 00 BA 87")


def sized(kind: Kind) -> st.SearchStrategy[bytes]:
    lengths = st.integers(1, 256).filter(lambda size: allows_size(kind, size))
    if kind is Kind.ACK:
        return st.just(b"\x00\x00")
    return lengths.flatmap(lambda size: st.binary(min_size=size, max_size=size))


@st.composite
def records(draw: st.DrawFn) -> Record:
    kind = draw(st.sampled_from(list(Kind)))
    request = kind in (Kind.READ, Kind.WRITE)
    address = draw(st.integers(NO_ADDRESS, 99)) if request else NO_ADDRESS
    return Record(kind, address, draw(st.integers(0, int(request))), draw(sized(kind)))


def test_read_request_equals_manual_example() -> None:
    assert read_request((Object(680, 5),), address=3) == READ_680_5
    assert decode_record(READ_680_5) == Record(Kind.READ, 3, 0, bytes.fromhex("02A805"))


def test_write_request_equals_manual_example() -> None:
    value = encode_value(NumberFormat.REAL48, 2350.0)
    assert write_request(Object(1901, 1), value, address=2) == WRITE_1901_1
    assert decode_record(WRITE_1901_1).data[3:] == value


def test_response_equals_manual_example() -> None:
    record = decode_record(RESPONSE)
    assert record == Record(Kind.RESPONSE, NO_ADDRESS, 0, bytes.fromhex("FFFFFFFFFE2D"))
    assert decode_value(NumberFormat.REAL48, record.data) == -467 / 2**24
    assert encode_record(record) == RESPONSE


def test_ack_equals_manual_example() -> None:
    assert decode_record(ACK) == Record(Kind.ACK, NO_ADDRESS, 0, b"\x00\x00")
    assert encode_record(decode_record(ACK)) == ACK
    assert error_number(decode_record(ACK)) == 0


def test_nak_carries_error_number() -> None:
    nak = encode_record(Record(Kind.NAK, NO_ADDRESS, 0, b"\x73\x20"))
    assert nak[:4] == bytes.fromhex("07 01 73 20")
    assert error_number(decode_record(nak)) == 29472


def test_without_an_address_no_address_byte_is_sent() -> None:
    assert read_request((Object(680, 5),))[:5] == bytes.fromhex("A4 02 02 A8 05")


def test_the_plc_bit_is_bit_three() -> None:
    assert read_request((Object(1000, 3),), plc=1)[0] == 0xAC
    assert write_request(Object(1100, 3), b"\x40\x03", address=7, plc=1)[:2] == b"\xcd\x07"


def test_one_request_reads_several_objects() -> None:
    request = read_request((Object(680, 5), Object(681, 5), Object(1000, 3)))
    assert request[:11] == bytes.fromhex("A4 08 02A805 02A905 03E803")
    data = bytes.fromhex("000001800000 FFFFFF 000064")
    forms = (NumberFormat.REAL48, NumberFormat.INT24, NumberFormat.INT24)
    assert decode_values(forms, data) == (1.5, -1.0, 100.0)
    with pytest.raises(CodecError, match="12 bytes"):
        decode_values(forms, data[:-1])


@pytest.mark.parametrize(
    "bad",
    [
        b"",
        b"\xa4",
        b"\xa5\x03",
        READ_680_5[:-1],
        READ_680_5 + b"\x00",
        READ_680_5[:-1] + b"\x47",
        b"\xa7" + READ_680_5[1:],  # gateway
        b"\xa1" + READ_680_5[1:],  # bit 2 is always 1
        RESPONSE[:2] + b"\x00" + RESPONSE[3:],
    ],
    ids=lambda data: data.hex(" ") or "nothing",
)
def test_bytes_that_are_no_record_are_refused(bad: bytes) -> None:
    with pytest.raises(CodecError, match="Compax3 record"):
        decode_record(bad)


@pytest.mark.parametrize(
    "bad",
    [
        Record(Kind.READ, NO_ADDRESS, 0, b""),
        Record(Kind.READ, NO_ADDRESS, 0, b"\x02\xa8"),
        Record(Kind.READ, 100, 0, b"\x02\xa8\x05"),
        Record(Kind.READ, NO_ADDRESS, 0, bytes(258)),
        Record(Kind.WRITE, NO_ADDRESS, 0, b"\x02\xa8\x05"),
        Record(Kind.WRITE, NO_ADDRESS, 2, b"\x02\xa8\x05\x00"),
        Record(Kind.RESPONSE, NO_ADDRESS, 0, bytes(254)),
        Record(Kind.RESPONSE, 3, 0, b"\x00"),
        Record(Kind.RESPONSE, NO_ADDRESS, 1, b"\x00"),
        Record(Kind.ACK, NO_ADDRESS, 0, b"\x00\x01"),
        Record(Kind.NAK, NO_ADDRESS, 0, b"\x00"),
    ],
)
def test_a_record_the_drive_would_not_take_is_refused_both_ways(bad: Record) -> None:
    with pytest.raises(CodecError):
        encode_record(bad)
    start = bad.kind | (8 if bad.plc == 1 else 0) | (1 if bad.address >= 0 else 0)
    head = bytes([start]) + (bytes([bad.address]) if bad.address >= 0 else b"")
    body = head + bytes([(len(bad.data) - 1) % 256]) + bad.data
    if bad.plc != 2:  # no third state fits in a bit
        with pytest.raises(CodecError):
            decode_record(body + compax3_crc16(body).to_bytes(2, "big"))


def test_objects_beyond_the_width_are_refused() -> None:
    for target in (Object(65536, 0), Object(0, 256), Object(-1, 0)):
        with pytest.raises(CodecError, match="object"):
            read_request((target,))


@given(records())
def test_round_trip(record: Record) -> None:
    assert decode_record(encode_record(record)) == record


@given(st.binary(max_size=300))
def test_any_bytes_decode_or_are_refused(data: bytes) -> None:
    with contextlib.suppress(CodecError):
        assert encode_record(decode_record(data)) == data


@given(records(), st.data())
def test_a_flipped_bit_is_detected(record: Record, data: st.DataObject) -> None:
    sent = bytearray(encode_record(record))
    bit = data.draw(st.integers(0, 8 * len(sent) - 1))
    sent[bit // 8] ^= 1 << bit % 8
    with pytest.raises(CodecError):
        decode_record(bytes(sent))
