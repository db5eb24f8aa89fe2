"""ATI Digital F/T on RS485 (1 250 000 baud 8E1): commands, and the stream of gauge samples.

Before and after streaming the box speaks Modbus RTU as unit 10. Once told to stream it answers,
waits 20 ms and sends 13-byte samples, about 7000 a second, until 14 or more bytes jam the bus.
Source: ATI 9620-05-Digital FT, section 8, in two public readings that agree.
"""

import struct
from typing import NamedTuple

from drivers.checksums import modbus_crc16
from drivers.errors import CodecError

UNIT = 10
STREAM, STORAGE = 0x46, 0x6A  # the maker's own Modbus functions
START_STREAM, UNLOCK, LOCK = 0x55, 0xAA, 0x18  # their data
DONE = 0x01  # data of their answer
REPLY_SIZE = 5
JAM_SIZE = 14  # bytes; fewer may be taken for noise
SAMPLE_SIZE = 13
CONFIRM = 3  # samples in a row with a right sum before a place is believed
_SEARCH_SIZE = SAMPLE_SIZE * (CONFIRM + 1)
_SAMPLE = struct.Struct(">6hB")


class Sample(NamedTuple):
    """One sample of the six strain gauges, in the order of the calibration matrix."""

    gauges: tuple[int, int, int, int, int, int]  # counts G0 to G5, -32768 to 32767
    fault: int  # 1: the box reports a status error; read its status registers


class State(NamedTuple):
    """What is undecided yet, and the counts of what went wrong so far."""

    pending: bytes
    locked: int  # 1: where samples begin is known
    prior: int  # 1: samples were found before, a multiple of 13 bytes before what is pending
    dropped: int  # bytes that belong to no sample
    searches: int  # times a wrong sum made the place doubtful


def command(function: int, data: int, unit: int = UNIT) -> bytes:
    """A command of the maker's own functions: STREAM with START_STREAM, STORAGE with UNLOCK."""
    body = bytes([unit, function, data])
    return body + modbus_crc16(body).to_bytes(2, "little")


def jam(size: int = JAM_SIZE) -> bytes:
    """Bytes that stop the stream; CodecError below 14. What they are does not matter."""
    if size < JAM_SIZE:
        raise CodecError("Digital F/T stop", "size", f"{JAM_SIZE} bytes or more", size)
    return b"\xff" * size


def confirm(function: int, reply: bytes, unit: int = UNIT) -> None:
    """CodecError unless the five bytes are the box's yes to a command."""
    wanted = command(function, DONE, unit)
    if reply != wanted:
        raise CodecError("Digital F/T reply", "bytes", wanted.hex(" "), reply.hex(" ") or "none")


def sum_holds(sample: bytes) -> bool:
    """True when bits 0-6 of the last of 13 bytes are the sum of the others."""
    return (sum(sample) - sample[-1]) & 0x7F == sample[-1] & 0x7F


def decode_sample(data: bytes) -> Sample:
    """The sample in 13 bytes; on the wire the gauges come in the order 0 2 4 1 3 5."""
    if len(data) != SAMPLE_SIZE:
        raise CodecError("Digital F/T sample", "length", f"{SAMPLE_SIZE} bytes", len(data))
    if not sum_holds(data):
        raise CodecError(
            "Digital F/T sample", "sum", f"{sum(data[:-1]) & 0x7F:02x}", f"{data[-1] & 0x7F:02x}"
        )
    return _sample(data)


def encode_sample(sample: Sample) -> bytes:
    """The 13 bytes of a sample; CodecError for a count that is no 16-bit number."""
    g0, g1, g2, g3, g4, g5 = sample.gauges
    if not all(-32768 <= gauge <= 32767 for gauge in sample.gauges) or sample.fault not in (0, 1):
        raise CodecError("Digital F/T sample", "fields", "16-bit gauges, fault 0 or 1", sample)
    body = struct.pack(">6h", g0, g2, g4, g1, g3, g5)
    return body + bytes([sum(body) & 0x7F | sample.fault << 7])


def saturated(sample: Sample, rail: int) -> int:
    """Bits 0-5: gauges whose count lies at or beyond +-``rail``.

    Where the converter's rail lies is not confirmed (the ends of 16 bits, 32767, are the latest
    possible place), so it is the rig's to state.
    """
    bits = 0
    for number, gauge in enumerate(sample.gauges):
        if not -rail < gauge < rail:
            bits |= 1 << number
    return bits


def start() -> State:
    """State in a stream that may be anywhere within a sample."""
    return State(b"", 0, 0, 0, 0)


def start_at_sample() -> State:
    """State right after the box's yes to START_STREAM: the next byte begins a sample."""
    return State(b"", 1, 1, 0, 0)


def feed(state: State, data: bytes) -> tuple[State, list[Sample]]:
    """Take in the bytes that came; gives the samples they complete, in order.

    How the bytes are split over calls changes nothing. A 7-bit sum is right by chance once in 128
    times, and a force that does not change makes a wrong place right again and again. So after a
    wrong sum nothing is given out until three samples in a row agree: first at the old place (a
    byte was corrupted), else at the only one of 13 places where they do (bytes were lost). While
    several places fit, none is believed. What the sum cannot see is a flipped highest bit of any
    byte, and, once in 128 losses of bytes, one sample put together from two.
    """
    buffer = state.pending + data
    samples: list[Sample] = []
    _, locked, prior, dropped, searches = state
    at = 0
    while True:
        if locked:
            if len(buffer) - at < SAMPLE_SIZE:
                break
            window = buffer[at : at + SAMPLE_SIZE]
            if sum_holds(window):
                samples.append(_sample(window))
                at += SAMPLE_SIZE
            else:
                locked, searches = 0, searches + 1
            continue
        if len(buffer) - at < _SEARCH_SIZE:
            break
        skip = _next_sample(buffer, at, prior)
        locked = 1 if skip >= 0 else 0
        skip = skip if locked else SAMPLE_SIZE
        # Thrown away in whole samples, so the old place stays at a multiple of 13.
        at, dropped, prior = at + skip, dropped + skip, prior or locked
    return State(buffer[at:], locked, prior, dropped, searches), samples


def _sample(data: bytes) -> Sample:
    g0, g2, g4, g1, g3, g5, last = _SAMPLE.unpack(data)
    return Sample((g0, g1, g2, g3, g4, g5), last >> 7)


def _next_sample(buffer: bytes, at: int, prior: int) -> int:
    """How many bytes after ``at`` samples begin, -1 where that cannot be told."""
    if prior:
        for skip in (0, SAMPLE_SIZE):
            if _agree(buffer, at + skip):
                return skip
    places = [skip for skip in range(SAMPLE_SIZE) if _agree(buffer, at + skip)]
    return places[0] if len(places) == 1 else -1


def _agree(buffer: bytes, at: int) -> bool:
    return all(
        sum_holds(buffer[at + n * SAMPLE_SIZE : at + (n + 1) * SAMPLE_SIZE]) for n in range(CONFIRM)
    )
