"""ATI Net F/T: requests and records of its UDP stream (RDT, port 49152, big-endian).

The box serves one client, the last one that sent a start. It sends records until stopped and does
not announce an end, so only the age of the last record shows that the stream has ended.
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
    Vector6,
    make_scale,
)

RDT_PORT, TCP_PORT = 49152, 49151
RECORD_SIZE, REQUEST_SIZE = 36, 8
MAX_RECORDS = 40  # per buffered datagram; more would not fit an Ethernet frame
READ_CALIBRATION = b"\x01" + bytes(19)  # TCP request; the answer has 24 bytes
_MAGIC = 0x1234
_REQUEST, _RECORD = struct.Struct(">HHI"), struct.Struct(">3I6i")
_CALIBRATION = struct.Struct(">HBBII6H")
_SEQUENCES = 1 << 32


class Command(IntEnum):
    """Command of a request."""

    STOP = 0x0000
    START = 0x0002  # one record per datagram, up to 7000 a second
    START_BUFFERED = 0x0003  # several records per datagram
    START_MULTI_UNIT = 0x0004
    RESET_LATCH = 0x0041  # resets the latch of the monitor conditions
    BIAS = 0x0042  # tare: the present load becomes 0


class Request(NamedTuple):
    """Request of the host."""

    command: Command
    records: int  # number of records to send, 0: until stopped


class Record(NamedTuple):
    """One measurement."""

    rdt_sequence: int  # 1 for the first record after a start, wraps at 2**32
    ft_sequence: int  # the sensor's time base: increments with each internal sample
    status: int  # 32 bits, see `decode_status`
    counts: tuple[int, int, int, int, int, int]  # Fx Fy Fz Tx Ty Tz


class State(NamedTuple):
    """Sequence number of the last record, and error counts since the start."""

    last_sequence: int  # 0 before the first record
    missing: int  # records lost according to the sequence numbers
    repeated: int  # records received before, or overtaken; not returned
    bad_datagrams: int  # datagrams that are not a whole number of records


class StatusBits(NamedTuple):
    """Meaning of the status bits in one model of box; masks of 32 bits."""

    harmless: int  # may be set in a good record
    saturated: int  # the load is beyond the sensor's range
    broken: int  # a gauge is open or its excitation is wrong


# A record is good only if every status bit is 0 except the harmless ones.
# Net F/T box: bit 17 saturation or converter error, 16 monitor condition (which also sets 31),
# 9 and 8 excitation current. From a public driver's table of the manual's 18.2; the manual page
# itself was not available, so no bit counts as harmless.
NET_FT_BITS = StatusBits(harmless=0, saturated=1 << 17, broken=1 << 9 | 1 << 8)
# Ethernet Axia: bit 30 force or torque out of range, 27 gauge out of range, 2 broken gauge.
# Source: ATI 9610-05-Ethernet Axia-09, table 4.7.
AXIA_BITS = StatusBits(harmless=0, saturated=1 << 30 | 1 << 27, broken=1 << 2)


class StatusFaults(NamedTuple):
    """Faults in a status, each 0 or 1."""

    any: int  # 1: the record must not be used
    saturated: int
    broken: int


def encode_request(request: Request) -> bytes:
    """Return the 8 bytes of a request; CodecError for a count beyond 32 bits."""
    if not 0 <= request.records < _SEQUENCES:
        raise CodecError("RDT request", "count", "32 bits", request.records)
    return _REQUEST.pack(_MAGIC, request.command, request.records)


def decode_request(data: bytes) -> Request:
    """Return the request in 8 bytes; CodecError for anything else."""
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
    """Return the 36 bytes of a record; CodecError for a field that does not fit."""
    try:
        return _RECORD.pack(*record[:3], *record.counts)
    except struct.error:
        raise CodecError("RDT record", "fields", "32 bits each", record) from None


def decode_record(data: bytes) -> Record:
    """Return the record in 36 bytes; CodecError for a wrong length (any content is valid)."""
    if len(data) != RECORD_SIZE:
        raise CodecError("RDT record", "length", f"{RECORD_SIZE} bytes", len(data))
    rdt, ft, status, fx, fy, fz, tx, ty, tz = _RECORD.unpack(data)
    return Record(rdt, ft, status, (fx, fy, fz, tx, ty, tz))


def start() -> State:
    """Return the state after a start request: the box counts from 1 again."""
    return State(0, 0, 0, 0)


def feed(state: State, datagram: bytes) -> tuple[State, list[Record]]:
    """Return the new state and the new records of one datagram, in order.

    Records before the first received one count as missing too. A record whose number does not
    increase is not returned: after a restart of the box its records are ignored until the stream
    is started again.
    """
    size = len(datagram)
    if size == 0 or size % RECORD_SIZE or size > MAX_RECORDS * RECORD_SIZE:
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


def decode_status(bits: StatusBits, status: int) -> StatusFaults:
    """Return the faults in a record's status."""
    return StatusFaults(
        1 if status & ~bits.harmless else 0,
        1 if status & bits.saturated else 0,
        1 if status & bits.broken else 0,
    )


def counts_as_floats(record: Record) -> Vector6:
    """Return a record's counts as floats for `wrench.to_si`."""
    fx, fy, fz, tx, ty, tz = record.counts
    return float(fx), float(fy), float(fz), float(tx), float(ty), float(tz)


def decode_calibration(reply: bytes) -> Scale:
    """Return the scale (SI per count) in the answer to READ_CALIBRATION; else CodecError."""
    if len(reply) != _CALIBRATION.size:
        raise CodecError("Net F/T calibration", "length", f"{_CALIBRATION.size}", len(reply))
    magic, force, torque, per_force, per_torque, *_ = _CALIBRATION.unpack(reply)
    if magic != _MAGIC:
        raise CodecError("Net F/T calibration", "header", f"{_MAGIC:04x}", f"{magic:04x}")
    for where, code in (("force unit", force), ("torque unit", torque)):
        if not 1 <= code <= len(NET_FT_FORCE_UNITS):
            raise CodecError("Net F/T calibration", where, "1 to 6", code)
    units = NET_FT_FORCE_UNITS[force - 1], NET_FT_TORQUE_UNITS[torque - 1]
    return make_scale(per_force, per_torque, *units)
