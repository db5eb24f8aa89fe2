"""ATI Digital F/T on RS485 (1 250 000 baud 8E1): commands, and the stream of gauge samples.

Outside streaming the box is a Modbus RTU device with unit number 10. After the start command it
answers, waits 20 ms and sends 13-byte samples, about 7000 a second, until 14 or more bytes jam the
bus.
Source: ATI 9620-05-Digital FT, section 8, from two public implementations that agree.
"""

import struct
from typing import NamedTuple

from drivers.checksums import modbus_crc16
from drivers.errors import CodecError

UNIT = 10
STREAM, STORAGE = 0x46, 0x6A  # the manufacturer's own Modbus functions
START_STREAM, UNLOCK, LOCK = 0x55, 0xAA, 0x18  # their data
SUCCESS = 0x01  # data of their answer
REPLY_SIZE = 5
JAM_SIZE = 14  # bytes; the box may ignore fewer as noise
SAMPLE_SIZE = 13
CONFIRMING_SAMPLES = 3  # consecutive samples with a valid checksum that confirm a sample boundary
_SEARCH_SIZE = SAMPLE_SIZE * (CONFIRMING_SAMPLES + 1)
_SAMPLE = struct.Struct(">6hB")


class Sample(NamedTuple):
    """One sample of the six strain gauges, in the order of the calibration matrix."""

    gauges: tuple[int, int, int, int, int, int]  # counts G0 to G5, -32768 to 32767
    fault: int  # 1: the box reports a status error; read its status registers


class State(NamedTuple):
    """Unparsed bytes, and error counts since the start."""

    pending: bytes
    locked: int  # 1: the sample boundary is known
    was_locked: int  # 1: an earlier sample began a multiple of 13 bytes before the pending bytes
    dropped: int  # bytes that belong to no sample
    searches: int  # times that a wrong checksum started a search for the boundary


def encode_command(function: int, data: int, unit: int = UNIT) -> bytes:
    """Return a command frame: STREAM with START_STREAM, or STORAGE with UNLOCK or LOCK."""
    body = bytes([unit, function, data])
    return body + modbus_crc16(body).to_bytes(2, "little")


def encode_jam(size: int = JAM_SIZE) -> bytes:
    """Return ``size`` bytes of arbitrary value that stop the stream; CodecError below 14."""
    if size < JAM_SIZE:
        raise CodecError("Digital F/T stop", "size", f"{JAM_SIZE} bytes or more", size)
    return b"\xff" * size


def check_reply(function: int, reply: bytes, unit: int = UNIT) -> None:
    """Raise CodecError unless ``reply`` is the box's five-byte confirmation of a command."""
    expected = encode_command(function, SUCCESS, unit)
    if reply != expected:
        raise CodecError("Digital F/T reply", "bytes", expected.hex(" "), reply.hex(" ") or "none")


def is_checksum_valid(sample: bytes) -> bool:
    """Return True when bits 0-6 of the last of 13 bytes are the sum of the other bytes."""
    return (sum(sample) - sample[-1]) & 0x7F == sample[-1] & 0x7F


def decode_sample(data: bytes) -> Sample:
    """Return the sample in 13 bytes; on the wire the gauges have the order 0 2 4 1 3 5."""
    if len(data) != SAMPLE_SIZE:
        raise CodecError("Digital F/T sample", "length", f"{SAMPLE_SIZE} bytes", len(data))
    if not is_checksum_valid(data):
        raise CodecError(
            "Digital F/T sample", "sum", f"{sum(data[:-1]) & 0x7F:02x}", f"{data[-1] & 0x7F:02x}"
        )
    return _unpack_sample(data)


def encode_sample(sample: Sample) -> bytes:
    """Return the 13 bytes of a sample; CodecError for a count that is not a 16-bit number."""
    g0, g1, g2, g3, g4, g5 = sample.gauges
    if not all(-32768 <= gauge <= 32767 for gauge in sample.gauges) or sample.fault not in (0, 1):
        raise CodecError("Digital F/T sample", "fields", "16-bit gauges, fault 0 or 1", sample)
    body = struct.pack(">6h", g0, g2, g4, g1, g3, g5)
    return body + bytes([sum(body) & 0x7F | sample.fault << 7])


def saturated_gauges(sample: Sample, rail: int) -> int:
    """Return a bit mask (bits 0-5) of the gauges whose count lies at or beyond +-``rail``.

    The count at which the converter saturates is not confirmed (at most 32767, the end of 16 bits),
    so the rig's configuration sets it.
    """
    bits = 0
    for number, gauge in enumerate(sample.gauges):
        if not -rail < gauge < rail:
            bits |= 1 << number
    return bits


def start() -> State:
    """Return the state for a stream whose sample boundary is unknown."""
    return State(b"", 0, 0, 0, 0)


def start_at_sample() -> State:
    """Return the state after the confirmation of START_STREAM: the next byte begins a sample."""
    return State(b"", 1, 1, 0, 0)


def feed(state: State, data: bytes) -> tuple[State, list[Sample]]:
    """Return the new state and the samples that the received bytes complete, in order.

    The result does not depend on how the bytes are split over calls. A 7-bit checksum is right by
    chance once in 128 times, and under a constant force it stays right at a wrong boundary. So
    after a wrong checksum no sample is returned until three consecutive ones are valid: first at
    the old boundary (a byte was corrupted), else at the only one of 13 possible boundaries that
    fits (bytes were lost). While several boundaries fit, none is accepted. The checksum cannot
    detect a flipped highest bit of any byte nor, once in 128 losses of bytes, one sample that is
    composed of two.
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
            if is_checksum_valid(window):
                samples.append(_unpack_sample(window))
                at += SAMPLE_SIZE
            else:
                locked, searches = 0, searches + 1
            continue
        if len(buffer) - at < _SEARCH_SIZE:
            break
        skip = _find_sample(buffer, at, prior)
        locked = 1 if skip >= 0 else 0
        skip = skip if locked else SAMPLE_SIZE
        # Whole samples are dropped, so the old boundary stays at a multiple of 13 bytes.
        at, dropped, prior = at + skip, dropped + skip, prior or locked
    return State(buffer[at:], locked, prior, dropped, searches), samples


def _unpack_sample(data: bytes) -> Sample:
    g0, g2, g4, g1, g3, g5, last = _SAMPLE.unpack(data)
    return Sample((g0, g1, g2, g3, g4, g5), last >> 7)


def _find_sample(buffer: bytes, at: int, prior: int) -> int:
    """Return how many bytes after ``at`` a sample begins, -1 if that is not certain."""
    if prior:
        for skip in (0, SAMPLE_SIZE):
            if _are_samples_valid(buffer, at + skip):
                return skip
    candidates = [skip for skip in range(SAMPLE_SIZE) if _are_samples_valid(buffer, at + skip)]
    return candidates[0] if len(candidates) == 1 else -1


def _are_samples_valid(buffer: bytes, at: int) -> bool:
    return all(
        is_checksum_valid(buffer[at + n * SAMPLE_SIZE : at + (n + 1) * SAMPLE_SIZE])
        for n in range(CONFIRMING_SAMPLES)
    )
