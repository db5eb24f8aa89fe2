"""ATI Net F/T over UDP: golden bytes, sequence gaps, status words, any datagram."""

from __future__ import annotations

import contextlib
import struct
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from stream_pieces import drain

from drivers.errors import CodecError
from drivers.force_torque.net_ft import (
    AXIA_BITS,
    MAX_RECORDS,
    NET_FT_BITS,
    RDT_PORT,
    READ_CALIBRATION,
    TCP_PORT,
    Command,
    Record,
    Request,
    State,
    StatusFaults,
    counts_as_floats,
    decode_calibration,
    decode_record,
    decode_request,
    decode_status,
    encode_record,
    encode_request,
    feed,
    start,
)
from drivers.force_torque.wrench import to_si

u32, i32 = st.integers(0, 2**32 - 1), st.integers(-(2**31), 2**31 - 1)
records = st.builds(Record, u32, u32, u32, st.tuples(i32, i32, i32, i32, i32, i32))
GOLDEN = Record(1, 256, 0x80020000, (1_000_000, -1, 2, -2, 2**31 - 1, -(2**31)))
GOLDEN_BYTES = bytes.fromhex(
    "00000001 00000100 80020000 000F4240 FFFFFFFF 00000002 FFFFFFFE 7FFFFFFF 80000000"
)


def numbered(*numbers: int) -> list[bytes]:
    return [encode_record(GOLDEN._replace(rdt_sequence=number)) for number in numbers]


@pytest.mark.parametrize(
    ("request_", "data"),
    [
        (Request(Command.STOP, 0), "1234 0000 00000000"),
        (Request(Command.START, 0), "1234 0002 00000000"),
        (Request(Command.START, 7000), "1234 0002 00001B58"),
        (Request(Command.START_BUFFERED, 0), "1234 0003 00000000"),
        (Request(Command.RESET_LATCH, 0), "1234 0041 00000000"),
        (Request(Command.BIAS, 0), "1234 0042 00000000"),
    ],
)
def test_requests_are_golden(request_: Request, data: str) -> None:
    assert encode_request(request_) == bytes.fromhex(data)
    assert decode_request(bytes.fromhex(data)) == request_


def test_a_record_is_golden() -> None:
    assert decode_record(GOLDEN_BYTES) == GOLDEN
    assert encode_record(GOLDEN) == GOLDEN_BYTES


@given(records)
def test_round_trip(record: Record) -> None:
    assert decode_record(encode_record(record)) == record


@given(st.binary(max_size=50) | st.binary(min_size=36, max_size=36))
def test_any_bytes_are_a_record_or_refused(data: bytes) -> None:
    with contextlib.suppress(CodecError):
        assert encode_record(decode_record(data)) == data


@given(st.binary(max_size=12) | st.binary(min_size=6, max_size=6).map(b"\x12\x34".__add__))
def test_any_bytes_are_a_request_or_refused(data: bytes) -> None:
    with contextlib.suppress(CodecError):
        assert encode_request(decode_request(data)) == data


def test_fields_out_of_range_are_not_encoded() -> None:
    with pytest.raises(CodecError, match="count"):
        encode_request(Request(Command.START, 2**32))
    with pytest.raises(CodecError, match="fields"):
        encode_record(GOLDEN._replace(status=-1))


def test_records_in_order_are_returned() -> None:
    state, got = drain(feed, start(), numbered(1, 2, 3))
    assert [record.rdt_sequence for record in got] == [1, 2, 3]
    assert state == State(3, 0, 0, 0)


def test_a_datagram_may_hold_several() -> None:
    state, got = feed(start(), b"".join(numbered(1, 2, 4)))
    assert [record.rdt_sequence for record in got] == [1, 2, 4]
    assert state.missing == 1


def test_gaps_are_counted_exactly_and_over_the_wrap() -> None:
    begin = State(2**32 - 2, 0, 0, 0)
    state, got = drain(feed, begin, numbered(2**32 - 1, 0, 4))
    assert len(got) == 3
    assert state.missing == 3
    assert feed(start(), numbered(3)[0])[0].missing == 2


def test_repeated_and_overtaken_records_are_dropped() -> None:
    state, got = drain(feed, start(), numbered(1, 3, 3, 2, 4))
    assert [record.rdt_sequence for record in got] == [1, 3, 4]
    assert (state.repeated, state.missing, state.last_sequence) == (2, 1, 4)


@given(st.sets(st.integers(1, 300), min_size=1))
def test_returned_and_missing_records_add_up(numbers: set[int]) -> None:
    state, got = drain(feed, start(), numbered(*sorted(numbers)))
    assert len(got) == len(numbers)
    assert state.missing == max(numbers) - len(numbers)


@given(st.lists(st.binary(max_size=80) | records.map(encode_record), max_size=10))
def test_any_datagrams_are_records_or_counted(datagrams: list[bytes]) -> None:
    state, got = drain(feed, start(), datagrams)
    complete = [data for data in datagrams if data and len(data) % 36 == 0]
    assert state.bad_datagrams == len(datagrams) - len(complete)
    assert len(got) + state.repeated == sum(len(data) // 36 for data in complete)
    assert all(a.rdt_sequence != b.rdt_sequence for a, b in pairwise(got))


def test_an_invalid_datagram_is_counted() -> None:
    many = b"".join(numbered(*range(1, MAX_RECORDS + 2)))
    state, got = drain(feed, start(), [b"", GOLDEN_BYTES[:-1], GOLDEN_BYTES + b"\x00", many])
    assert got == []
    assert state.bad_datagrams == 4


def test_a_full_datagram_is_taken() -> None:
    state, got = feed(start(), b"".join(numbered(*range(1, MAX_RECORDS + 1))))
    assert len(got) == MAX_RECORDS
    assert state.bad_datagrams == 0


def test_ports_are_the_boxs() -> None:
    assert (RDT_PORT, TCP_PORT) == (49152, 49151)


@pytest.mark.parametrize("bit", range(32))
def test_each_status_bit_means_what_the_tables_say(bit: int) -> None:
    net, axia = decode_status(NET_FT_BITS, 1 << bit), decode_status(AXIA_BITS, 1 << bit)
    assert net == StatusFaults(1, int(bit == 17), int(bit in (8, 9)))
    assert axia == StatusFaults(1, int(bit in (27, 30)), int(bit == 2))


def test_status_words() -> None:
    assert decode_status(NET_FT_BITS, 0) == StatusFaults(0, 0, 0)
    assert decode_status(NET_FT_BITS, 0x80020000) == StatusFaults(1, 1, 0)
    assert decode_status(NET_FT_BITS, 0x80000200) == StatusFaults(1, 0, 1)
    assert decode_status(NET_FT_BITS, 0x80010000) == StatusFaults(1, 0, 0)
    lenient = NET_FT_BITS._replace(harmless=0x80010000)
    assert decode_status(lenient, 0x80010000) == StatusFaults(0, 0, 0)
    assert decode_status(AXIA_BITS, 0xC0000000) == StatusFaults(1, 1, 0)
    assert decode_status(AXIA_BITS, 0x80000004) == StatusFaults(1, 0, 1)


def calibration(magic: int = 0x1234, force: int = 2, torque: int = 3, per: int = 10**6) -> bytes:
    return struct.pack(">HBBII6H", magic, force, torque, per, 10**6, *range(6))


def test_counts_become_newtons_by_the_boxs_own_calibration() -> None:
    assert len(READ_CALIBRATION) == 20
    assert READ_CALIBRATION[0] == 1
    wrench = to_si(decode_calibration(calibration()), counts_as_floats(GOLDEN))
    assert (wrench.fx, wrench.fy, wrench.tx) == pytest.approx((1.0, -1e-6, -2e-6))
    feet = to_si(decode_calibration(calibration(torque=2)), counts_as_floats(GOLDEN))
    assert feet.tx == pytest.approx(-2e-6 * 1.3558179483314004)
    pounds = to_si(decode_calibration(calibration(force=1)), counts_as_floats(GOLDEN))
    assert pounds.fx == pytest.approx(4.4482216152605)


@pytest.mark.parametrize(
    ("reply", "where"),
    [
        (b"", "length"),
        (calibration(magic=0x3412), "header"),
        (calibration(force=0), "force unit"),
        (calibration(torque=7), "torque unit"),
        (calibration(per=0), "counts per force"),
    ],
)
def test_another_answer_is_refused_by_name(reply: bytes, where: str) -> None:
    with pytest.raises(CodecError, match=where):
        decode_calibration(reply)


@given(st.binary(max_size=30) | st.binary(min_size=24, max_size=24))
def test_any_answer_is_a_scale_or_refused(reply: bytes) -> None:
    with contextlib.suppress(CodecError):
        assert min(decode_calibration(reply)) > 0.0
