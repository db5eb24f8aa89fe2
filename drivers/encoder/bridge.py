"""The `wec-rig encoder bridge`: this project's own frame for two encoder words at one instant.

SSI cannot be read by a serial port, so a small processor clocks both encoders (motor and shaft) by
one edge and sends what came as one frame, the moment of the edge included. No maker speaks this
protocol; its byte table is docs/encoder_bridge.md.
"""

import struct
from typing import NamedTuple

from drivers.checksums import crc16
from drivers.encoder.ssi import BITS, Protocol
from drivers.errors import CodecError

SYNC = b"\xeb\x90"
VERSION = 1
SIZE = 26
# Status bits; the others are 0.
MOTOR_SILENT = 0x01  # its data line did not answer the clock: the word is no reading
SHAFT_SILENT = 0x02
LATE = 0x04  # a period was skipped since the frame before
RESTARTED = 0x08  # first frame after the bridge's start: its time began anew
_STATUS = MOTOR_SILENT | SHAFT_SILENT | LATE | RESTARTED
_LAYOUT = struct.Struct(">2sBBHQBBIIH")
_SEQUENCES = 1 << 16
_WHAT = "encoder bridge frame"
_PROTOCOLS = {int(protocol): (protocol, 1 << BITS[protocol]) for protocol in Protocol}


class Frame(NamedTuple):
    """Both words, latched by one edge."""

    sequence: int  # 0 to 65535, one more each frame, wraps
    status: int  # the bits above
    time_us: int  # of the edge, on the bridge's clock; 64 bits do not wrap
    motor_protocol: Protocol
    motor_word: int
    shaft_protocol: Protocol
    shaft_word: int


class State(NamedTuple):
    """What is undecided yet, and the counts of what went wrong so far."""

    pending: bytes
    last: int  # sequence number of the last frame, -1 before the first
    dropped: int  # bytes that belong to no frame
    bad_frames: int  # sync bytes that a check sum or content speaks against
    missing: int  # frames that the sequence numbers say were sent and did not come
    repeated: int  # frames with the number of the one before; not given out
    backward: int  # frames with an earlier number: the bridge began anew and its first was lost


def encode(frame: Frame) -> bytes:
    """The 26 bytes of a frame; CodecError for a field that does not fit."""
    for where, value, bits in (("sequence", frame.sequence, 16), ("time", frame.time_us, 64)):
        if not 0 <= value < 1 << bits:
            raise CodecError(_WHAT, where, f"{bits} bits", hex(value))
    if not 0 <= frame.status <= _STATUS:
        raise CodecError(_WHAT, "status", "bits 0 to 3", hex(frame.status))
    _protocol("motor", frame.motor_protocol, frame.motor_word)
    _protocol("shaft", frame.shaft_protocol, frame.shaft_word)
    body = _LAYOUT.pack(
        SYNC, VERSION, frame.status, frame.sequence, frame.time_us,
        frame.motor_protocol, frame.shaft_protocol, frame.motor_word, frame.shaft_word, 0,
    )[:-2]  # fmt: skip
    return body + crc16(body[len(SYNC) :]).to_bytes(2, "big")


def decode(data: bytes) -> Frame:
    """The frame that fills ``data`` exactly; CodecError for anything else."""
    if len(data) != SIZE:
        raise CodecError(_WHAT, "length", f"{SIZE} bytes", len(data))
    sync, version, status, sequence, time_us, motor, shaft, motor_word, shaft_word, found = (
        _LAYOUT.unpack(data)
    )
    if sync != SYNC:
        raise CodecError(_WHAT, "sync", SYNC.hex(" "), sync.hex(" "))
    wanted = crc16(data[len(SYNC) : -2])
    if found != wanted:
        raise CodecError(_WHAT, "check sum", f"{wanted:04x}", f"{found:04x}")
    if version != VERSION:
        raise CodecError(_WHAT, "version", str(VERSION), version)
    if status & ~_STATUS:
        raise CodecError(_WHAT, "status", "bits 0 to 3", f"{status:02x}")
    motor_protocol = _protocol("motor", motor, motor_word)
    shaft_protocol = _protocol("shaft", shaft, shaft_word)
    return Frame(sequence, status, time_us, motor_protocol, motor_word, shaft_protocol, shaft_word)


def start() -> State:
    """State of a line just opened."""
    return State(b"", -1, 0, 0, 0, 0, 0)


def feed(state: State, data: bytes) -> tuple[State, list[Frame]]:
    """Take in the bytes that came; gives the frames they complete, in order.

    How the bytes are split over calls changes nothing. After a bad frame the search goes on at its
    second byte, so noise that looks like a sync costs no frame behind it. A frame that says
    RESTARTED is not held against the sequence number before it.
    """
    buffer = state.pending + data
    frames: list[Frame] = []
    _, last, dropped, bad_frames, missing, repeated, backward = state
    at = 0
    while True:
        found = buffer.find(SYNC, at)
        if found < 0:
            # The last byte may be the first half of a sync.
            keep = 1 if buffer[at:].endswith(SYNC[:1]) else 0
            dropped += len(buffer) - at - keep
            at = len(buffer) - keep
            break
        dropped, at = dropped + found - at, found
        if len(buffer) - at < SIZE:
            break
        try:
            frame = decode(buffer[at : at + SIZE])
        except CodecError:
            at, dropped, bad_frames = at + 1, dropped + 1, bad_frames + 1
            continue
        at += SIZE
        if frame.sequence == last:
            repeated += 1
            continue
        if last >= 0 and not frame.status & RESTARTED:
            ahead = (frame.sequence - last) % _SEQUENCES
            if ahead < _SEQUENCES // 2:
                missing += ahead - 1
            else:
                backward += 1
        frames.append(frame)
        last = frame.sequence
    return State(buffer[at:], last, dropped, bad_frames, missing, repeated, backward), frames


def _protocol(which: str, number: int, word: int) -> Protocol:
    protocol, limit = _PROTOCOLS.get(number, (None, 0))
    if protocol is None:
        raise CodecError(_WHAT, f"{which} protocol", "1, 2, 4, 6 or 9", number)
    if not 0 <= word < limit:
        raise CodecError(_WHAT, f"{which} word", f"{BITS[protocol]} bits", hex(word))
    return protocol
