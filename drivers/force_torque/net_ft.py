"""ATI Net F/T: requests and records of its UDP stream (RDT, port 49152, big-endian).

One client at a time: whoever asks last gets the stream. The box sends records until stopped, so a
stream that ends says nothing; only the age of the last record does.
Source: ATI Net F/T manual 9620-05-net ft, sections 5, 10 and 11.
"""

import struct
from enum import IntEnum
from typing import NamedTuple

from drivers.errors import CodecError
from drivers.force_torque.wrench import (
    NET_FT_FORCE_UNITS,
    NET_FT_TORQUE_UNITS,
    Scale,
    Six,
    scale,
)

RDT_PORT, TCP_PORT = 49152, 49151
RECORD_SIZE, REQUEST_SIZE = 36, 8
MOST_RECORDS = 40  # of one buffered datagram; more would not fit an Ethernet frame
READ_CALIBRATION = b"\x01" + bytes(19)  # TCP request; 24 bytes come back
_MAGIC = 0x1234
_REQUEST, _RECORD = struct.Struct(">HHI"), struct.Struct(">3I6i")
_CALIBRATION = struct.Struct(">HBBII6H")
_SEQUENCES = 1 << 32


class Command(IntEnum):
    """What a request asks for."""

    STOP = 0x0000
    START = 0x0002  # one record a datagram, up to 7000 a second
    START_BUFFERED = 0x0003  # several records a datagram
    START_MULTI_UNIT = 0x0004
    RESET_LATCH = 0x0041  # of the monitor conditions
    BIAS = 0x0042  # tare: the present load reads 0 from now on


class Request(NamedTuple):
    """What the host sends."""

    command: Command
    records: int  # how many to send, 0: until stopped


class Record(NamedTuple):
    """One measurement."""

    rdt_sequence: int  # 1 with the first record after a start, wraps at 2**32
    ft_sequence: int  # the sensor's own time base: one more each internal sample
    status: int  # 32 bits, see `faults`
    counts: tuple[int, int, int, int, int, int]  # Fx Fy Fz Tx Ty Tz


class State(NamedTuple):
    """The last record's number, and the counts of what went wrong since the start."""

    last: int  # 0 before the first record
    missing: int  # records that the numbers say were sent and did not come
    repeated: int  # records that had come before, or were overtaken; not given out
    bad_datagrams: int  # not a whole number of records


class StatusBits(NamedTuple):
    """What the bits of a status mean in one model of box; masks of 32 bits."""

    harmless: int  # may be set in a good record
    saturated: int  # the load is beyond what the sensor can measure
    broken: int  # a gauge is open or its excitation is wrong


# From 0 on a record is only good if its status is 0 but for the harmless bits.
# Net F/T box: bit 17 saturation or converter error, 16 monitor condition (which also sets 31),
# 9 and 8 excitation current. From a public driver's table of the manual's 18.2; the page itself was
# not at hand, so nothing is called harmless.
NET_FT_BITS = StatusBits(harmless=0, saturated=1 << 17, broken=1 << 9 | 1 << 8)
# Ethernet Axia: bit 30 force or torque out of range, 27 gauge out of range, 2 broken gauge.
# Source: ATI 9610-05-Ethernet Axia-09, table 4.7.
AXIA_BITS = StatusBits(harmless=0, saturated=1 << 30 | 1 << 27, broken=1 << 2)


class Faults(NamedTuple):
    """What a status says, each 0 or 1."""

    any: int  # the record is not to be used
    saturated: int
    broken: int


def encode_request(request: Request) -> bytes:
    """The 8 bytes of a request; CodecError for a count beyond 32 bits."""
    if not 0 <= request.records < _SEQUENCES:
        raise CodecError("RDT request", "count", "32 bits", request.records)
    return _REQUEST.pack(_MAGIC, request.command, request.records)


def decode_request(data: bytes) -> Request:
    """The request in 8 bytes; CodecError for anything else."""
    if len(data) != REQUEST_SIZE:
        raise CodecError("RDT request", "length", f"{REQUEST_SIZE} bytes", len(data))
    magic, number, count = _REQUEST.unpack(data)
    if magic != _MAGIC:
        raise CodecError("RDT request", "header", f"{_MAGIC:04x}", f"{magic:04x}")
    try:
        return Request(Command(number), count)
    except ValueError:
        raise CodecError("RDT request", "command", "0, 2-4, 41 or 42", f"{number:x}") from None


def encode_record(record: Record) -> bytes:
    """The 36 bytes of a record; CodecError for a field that does not fit."""
    try:
        return _RECORD.pack(*record[:3], *record.counts)
    except struct.error:
        raise CodecError("RDT record", "fields", "32 bits each", record) from None


def decode_record(data: bytes) -> Record:
    """The record in 36 bytes: all bits count, only the length can be wrong."""
    if len(data) != RECORD_SIZE:
        raise CodecError("RDT record", "length", f"{RECORD_SIZE} bytes", len(data))
    rdt, ft, status, fx, fy, fz, tx, ty, tz = _RECORD.unpack(data)
    return Record(rdt, ft, status, (fx, fy, fz, tx, ty, tz))


def start() -> State:
    """State to begin with after every start request: the box counts from 1 again."""
    return State(0, 0, 0, 0)


def feed(state: State, datagram: bytes) -> tuple[State, list[Record]]:
    """Take in one datagram; gives its new records, in order.

    Records before the first that came count as missing too. One whose number does not go forward
    is not given out: a box that began anew on its own goes silent here until it is started again.
    """
    size = len(datagram)
    if size == 0 or size % RECORD_SIZE or size > MOST_RECORDS * RECORD_SIZE:
        return state._replace(bad_datagrams=state.bad_datagrams + 1), []
    last, missing, repeated, bad = state
    records: list[Record] = []
    for at in range(0, size, RECORD_SIZE):
        record = decode_record(datagram[at : at + RECORD_SIZE])
        ahead = (record.rdt_sequence - last) % _SEQUENCES
        if 0 < ahead < _SEQUENCES // 2:
            records.append(record)
            missing += ahead - 1
            last = record.rdt_sequence
        else:
            repeated += 1
    return State(last, missing, repeated, bad), records


def faults(bits: StatusBits, status: int) -> Faults:
    """What a record's status says about it."""
    return Faults(
        1 if status & ~bits.harmless else 0,
        1 if status & bits.saturated else 0,
        1 if status & bits.broken else 0,
    )


def floats(record: Record) -> Six:
    """The counts as numbers for `wrench.in_si`."""
    fx, fy, fz, tx, ty, tz = record.counts
    return float(fx), float(fy), float(fz), float(tx), float(ty), float(tz)


def decode_calibration(reply: bytes) -> Scale:
    """SI per count, from the answer to READ_CALIBRATION; CodecError for anything else."""
    if len(reply) != _CALIBRATION.size:
        raise CodecError("Net F/T calibration", "length", f"{_CALIBRATION.size}", len(reply))
    magic, force, torque, per_force, per_torque, *_ = _CALIBRATION.unpack(reply)
    if magic != _MAGIC:
        raise CodecError("Net F/T calibration", "header", f"{_MAGIC:04x}", f"{magic:04x}")
    for where, code in (("force unit", force), ("torque unit", torque)):
        if not 1 <= code <= len(NET_FT_FORCE_UNITS):
            raise CodecError("Net F/T calibration", where, "1 to 6", code)
    units = NET_FT_FORCE_UNITS[force - 1], NET_FT_TORQUE_UNITS[torque - 1]
    return scale(per_force, per_torque, *units)
