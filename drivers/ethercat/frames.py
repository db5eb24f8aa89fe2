"""Frames of a segment: datagrams in an Ethernet frame (IEC 61158-4-12), and the frame of a tick.

The cyclic frame holds one LRW for all process data, one BRD of the AL status, one NOP with the
frame's number and, with distributed clocks, one FRMW of the reference clock. It is built once: a
tick changes number and outputs in place, and an answer is read where it lies.
"""

import struct
from enum import IntEnum
from typing import NamedTuple

from drivers.errors import CodecError

ETHERTYPE = 0x88A4
INDEX_PLACE = 17  # byte of a frame with the index of its first datagram, for filters of the kernel
MAX_PROCESS_DATA = 1400  # bytes of one LRW beside the other datagrams in a frame of 1514
_ETHERNET = struct.Struct(">6s6sH")
_LENGTH = struct.Struct("<H")  # 11 bits of length, type 1 in the 4 highest
_DATAGRAM = struct.Struct("<BBIHH")  # command, index, address, length and flags, interrupt
_WKC = struct.Struct("<H")
_TIME = struct.Struct("<Q")
_NUMBER = struct.Struct("<Q")
_STATES = struct.Struct("<HH")  # AL status, working counter of the broadcast
_HEAD = slice(18, 24)  # address and length of the first datagram: no slave changes them
_MORE = 0x8000  # another datagram follows
_TYPE = 1 << 12
_MIN_FRAME = 60  # bytes of an Ethernet frame without its check sequence
_BROADCAST = b"\xff" * 6
_OWN_ADDRESS = bytes.fromhex("020101010101")  # locally administered; slaves set bit 1 of it

AL_STATUS, SYSTEM_TIME = 0x0130, 0x0910  # registers of a slave


class Command(IntEnum):
    """Commands of a datagram."""

    NOP = 0
    APRD, APWR, APRW = 1, 2, 3
    FPRD, FPWR, FPRW = 4, 5, 6
    BRD, BWR, BRW = 7, 8, 9
    LRD, LWR, LRW = 10, 11, 12
    ARMW, FRMW = 13, 14


class Datagram(NamedTuple):
    """One datagram; the address is logical, or slave (low word) and register (high word)."""

    command: int
    tag: int  # its index: what finds the answer
    address: int
    data: bytes
    wkc: int = 0


def encode(datagrams: tuple[Datagram, ...]) -> bytes:
    """Return the Ethernet frame of datagrams, padded to its least length."""
    parts = []
    for place, each in enumerate(datagrams):
        more = _MORE if place < len(datagrams) - 1 else 0
        head = _DATAGRAM.pack(each.command, each.tag, each.address, len(each.data) | more, 0)
        parts += [head, each.data, _WKC.pack(each.wkc)]
    body = b"".join(parts)
    ethernet = _ETHERNET.pack(_BROADCAST, _OWN_ADDRESS, ETHERTYPE)
    return (ethernet + _LENGTH.pack(len(body) | _TYPE) + body).ljust(_MIN_FRAME, b"\0")


def decode(frame: bytes) -> tuple[Datagram, ...]:
    """Return the datagrams of a frame; CodecError for any other bytes."""
    if len(frame) < _ETHERNET.size + _LENGTH.size:
        raise CodecError("frame", "length", "an Ethernet frame", len(frame))
    (kind,) = struct.unpack_from(">H", frame, 12)
    (length,) = _LENGTH.unpack_from(frame, 14)
    if kind != ETHERTYPE or length >> 12 != 1:
        raise CodecError("frame", "type", "0x88a4 with commands", f"{kind:#06x}, {length >> 12}")
    at, end = 16, 16 + (length & 0x7FF)
    if end > len(frame):
        raise CodecError("frame", "length", f"at least {end} bytes", len(frame))
    found = []
    more = True
    while more:
        if at + _DATAGRAM.size + _WKC.size > end:
            raise CodecError("frame", "datagram", "a whole datagram", f"{end - at} bytes")
        command, tag, address, flags, _ = _DATAGRAM.unpack_from(frame, at)
        size, more = flags & 0x7FF, bool(flags & _MORE)
        at += _DATAGRAM.size
        if at + size + _WKC.size > end:
            raise CodecError("frame", "datagram", f"{size} bytes of data", f"{end - at} bytes")
        data = bytes(frame[at : at + size])
        (wkc,) = _WKC.unpack_from(frame, at + size)
        found.append(Datagram(command, tag, address, data, wkc))
        at += size + _WKC.size
    return tuple(found)


class Answer(NamedTuple):
    """The contents of a cyclic frame that came back, besides the process data."""

    number: int  # of the frame, as sent
    wkc: int  # working counter of the process data
    slaves: int  # that answered the broadcast
    al_status: int  # of all slaves, by bitwise or
    time_ns: int  # of the reference clock; 0 without distributed clocks


class CyclicFrame:
    """The frame of a tick."""

    def __init__(self, size: int, reference_clock: int | None) -> None:
        """``size``: bytes of process data, from address 0; ``reference_clock``: a station."""
        if not 0 < size <= MAX_PROCESS_DATA:
            raise CodecError("process data", "size", f"1 to {MAX_PROCESS_DATA} bytes", size)
        datagrams = [
            Datagram(Command.LRW, 0, 0, bytes(size)),
            Datagram(Command.BRD, 0, AL_STATUS << 16, bytes(2)),
            Datagram(Command.NOP, 0, 0, bytes(8)),  # no slave changes it: the frame's number
        ]
        if reference_clock is not None:
            address = reference_clock | SYSTEM_TIME << 16
            datagrams.append(Datagram(Command.FRMW, 0, address, bytes(8)))
        self.bytes = bytearray(encode(tuple(datagrams)))
        self._data = 16 + _DATAGRAM.size
        self._wkc = self._data + size
        self._status = self._wkc + _WKC.size + _DATAGRAM.size
        self._number = self._status + 2 + _WKC.size + _DATAGRAM.size
        self._time = self._number + _NUMBER.size + _WKC.size + _DATAGRAM.size
        self._has_time = reference_clock is not None
        self._head = bytes(self.bytes[_HEAD])
        self.outputs = memoryview(self.bytes)[self._data : self._wkc]

    def set_number(self, index: int, number: int) -> None:
        """Set the index, by which a socket finds the answer, and the number of the frame."""
        self.bytes[INDEX_PLACE] = index
        _NUMBER.pack_into(self.bytes, self._number, number)

    def is_answer(self, frame: bytearray, length: int) -> bool:
        """Return whether received bytes are this frame as it comes back."""
        return length >= len(self.bytes) and frame[_HEAD] == self._head

    def process_data(self, frame: bytearray) -> memoryview:
        """Return the process data within an answer."""
        return memoryview(frame)[self._data : self._wkc]

    def read(self, frame: bytearray) -> Answer:
        """Return the other contents of an answer."""
        (number,) = _NUMBER.unpack_from(frame, self._number)
        (wkc,) = _WKC.unpack_from(frame, self._wkc)
        status, slaves = _STATES.unpack_from(frame, self._status)
        (time_ns,) = _TIME.unpack_from(frame, self._time) if self._has_time else (0,)
        return Answer(number, wkc, slaves, status, time_ns)
