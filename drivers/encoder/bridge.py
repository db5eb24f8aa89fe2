"""Codec of the `wec-rig encoder bridge`: one frame with two SSI words latched at one instant.

A serial port cannot read SSI, so a small processor clocks both encoders (motor and shaft) with the
same edge and sends both words and the time of the edge as one frame. The protocol is this
project's own; docs/reference/wires.md has its byte table.
"""

import struct
from typing import NamedTuple

from drivers.checksums import crc16
from drivers.encoder.ssi import WORD_BITS, SsiProtocol
from drivers.errors import CodecError

SYNC = b"\xeb\x90"
VERSION = 1
SIZE = 26
# Status bits; the others are 0.
MOTOR_SILENT = 0x01  # the data line did not answer the clock: the word is invalid
SHAFT_SILENT = 0x02
LATE = 0x04  # the bridge skipped a period since the previous frame
RESTARTED = 0x08  # first frame after the bridge's start: its clock restarted
_STATUS = MOTOR_SILENT | SHAFT_SILENT | LATE | RESTARTED
_LAYOUT = struct.Struct(">2sBBHQBBIIH")
_SEQUENCES = 1 << 16
_SUBJECT = "encoder bridge frame"
_PROTOCOLS = {int(protocol): (protocol, 1 << WORD_BITS[protocol]) for protocol in SsiProtocol}


class Frame(NamedTuple):
    """Both SSI words, latched by one edge."""

    sequence: int  # 0 to 65535, increments with each frame, wraps
    status: int  # status bits, see above
    time_us: int  # time of the edge on the bridge's clock; 64 bits do not wrap
    motor_protocol: SsiProtocol
    motor_word: int
    shaft_protocol: SsiProtocol
    shaft_word: int


class State(NamedTuple):
    """Unparsed bytes, and error counts since the start."""

    pending: bytes
    last_sequence: int  # sequence number of the last frame, -1 before the first
    dropped: int  # bytes that belong to no frame
    bad_frames: int  # sync bytes followed by a wrong checksum or invalid content
    missing: int  # frames lost according to the sequence numbers
    repeated: int  # frames with the previous sequence number; not returned
    backward: int  # frames with an earlier number: the bridge restarted and its first was lost


def encode(frame: Frame) -> bytes:
    """Return the 26 bytes of a frame; CodecError for a field that does not fit."""
    for where, value, bits in (("sequence", frame.sequence, 16), ("time", frame.time_us, 64)):
        if not 0 <= value < 1 << bits:
            raise CodecError(_SUBJECT, where, f"{bits} bits", hex(value))
    if not 0 <= frame.status <= _STATUS:
        raise CodecError(_SUBJECT, "status", "bits 0 to 3", hex(frame.status))
    _check_protocol("motor", frame.motor_protocol, frame.motor_word)
    _check_protocol("shaft", frame.shaft_protocol, frame.shaft_word)
    body = _LAYOUT.pack(
        SYNC, VERSION, frame.status, frame.sequence, frame.time_us,
        frame.motor_protocol, frame.shaft_protocol, frame.motor_word, frame.shaft_word, 0,
    )[:-2]  # fmt: skip
    return body + crc16(body[len(SYNC) :]).to_bytes(2, "big")


def decode(data: bytes) -> Frame:
    """Return the frame that fills ``data`` exactly; CodecError for anything else."""
    if len(data) != SIZE:
        raise CodecError(_SUBJECT, "length", f"{SIZE} bytes", len(data))
    sync, version, status, sequence, time_us, motor, shaft, motor_word, shaft_word, received = (
        _LAYOUT.unpack(data)
    )
    if sync != SYNC:
        raise CodecError(_SUBJECT, "sync", SYNC.hex(" "), sync.hex(" "))
    expected = crc16(data[len(SYNC) : -2])
    if received != expected:
        raise CodecError(_SUBJECT, "check sum", f"{expected:04x}", f"{received:04x}")
    if version != VERSION:
        raise CodecError(_SUBJECT, "version", str(VERSION), version)
    if status & ~_STATUS:
        raise CodecError(_SUBJECT, "status", "bits 0 to 3", f"{status:02x}")
    motor_protocol = _check_protocol("motor", motor, motor_word)
    shaft_protocol = _check_protocol("shaft", shaft, shaft_word)
    return Frame(sequence, status, time_us, motor_protocol, motor_word, shaft_protocol, shaft_word)


def start() -> State:
    """Return the state of a line just opened."""
    return State(b"", -1, 0, 0, 0, 0, 0)


def feed(state: State, data: bytes) -> tuple[State, list[Frame]]:
    """Return the new state and the frames that the received bytes complete, in order.

    The result does not depend on how the bytes are split over calls. After a bad frame the search
    continues at its second byte, so noise that looks like a sync loses no later frame. A frame with
    RESTARTED set is not compared with the previous sequence number.
    """
    buffer = state.pending + data
    frames: list[Frame] = []
    _, last, dropped, bad_frames, missing, repeated, backward = state
    at = 0
    while True:
        sync_at = buffer.find(SYNC, at)
        if sync_at < 0:
            # The last byte may be the first byte of a sync.
            keep = 1 if buffer[at:].endswith(SYNC[:1]) else 0
            dropped += len(buffer) - at - keep
            at = len(buffer) - keep
            break
        dropped, at = dropped + sync_at - at, sync_at
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


def _check_protocol(which: str, number: int, word: int) -> SsiProtocol:
    protocol, limit = _PROTOCOLS.get(number, (None, 0))
    if protocol is None:
        raise CodecError(_SUBJECT, f"{which} protocol", "1, 2, 4, 6 or 9", number)
    if not 0 <= word < limit:
        raise CodecError(_SUBJECT, f"{which} word", f"{WORD_BITS[protocol]} bits", hex(word))
    return protocol
