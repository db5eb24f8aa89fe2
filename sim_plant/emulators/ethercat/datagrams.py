"""EtherCAT frames: Ethernet type 0x88A4, one header, datagrams (IEC 61158-4-12)."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from enum import IntEnum

ETHERTYPE = 0x88A4
ETHERNET_HEADER, HEADER = 14, 2  # octets
MIN_FRAME = 60  # octets without the check sequence
_DATAGRAM = struct.Struct("<BBIHH")  # command, index, address, length and flags, interrupts
_COUNTER = struct.Struct("<H")
OVERHEAD = _DATAGRAM.size + _COUNTER.size
LENGTH_MASK, MORE = 0x07FF, 0x8000
DATAGRAMS_TYPE = 1  # of the EtherCAT header
_SOURCE_CHANGED = 0x02  # bit of the first octet of the source address: the frame passed a slave


class Command(IntEnum):
    """Commands. AP: by place, FP: by station address, B: all, L: logical; RD, WR, RW."""

    NOP = 0
    APRD = 1
    APWR = 2
    APRW = 3
    FPRD = 4
    FPWR = 5
    FPRW = 6
    BRD = 7
    BWR = 8
    BRW = 9
    LRD = 10
    LWR = 11
    LRW = 12
    ARMW = 13  # the slave at the place reads, all others write
    FRMW = 14  # the same by station address


COMMANDS = frozenset(Command)


class FrameError(ValueError):
    """A frame that no slave understands."""


class Datagram:
    """One datagram under way; slaves change address, data and counter."""

    __slots__ = ("address", "command", "counter", "data", "flags", "index", "interrupts")

    def __init__(
        self, command: int, index: int, address: int, data: bytes, counter: int = 0
    ) -> None:
        """`address`: logical, or place or station in the low and offset in the high word."""
        self.command = command
        self.index = index
        self.address = address
        self.data = bytearray(data)
        self.counter = counter  # working counter
        self.flags = 0  # of the length field, without `MORE`
        self.interrupts = 0

    @property
    def place(self) -> int:
        """Place or station address: the low word of the address."""
        return self.address & 0xFFFF

    @property
    def offset(self) -> int:
        """Physical memory offset: the high word of the address."""
        return self.address >> 16


def physical(place: int, offset: int) -> int:
    """Return the address of a datagram for a place (0, -1, ..) or station, and a memory offset."""
    return (place & 0xFFFF) | offset << 16


def parse(frame: bytes) -> list[Datagram]:
    """Return the datagrams of an Ethernet frame. Raises FrameError if it is malformed."""
    if len(frame) < ETHERNET_HEADER + HEADER + OVERHEAD:
        raise FrameError(f"{len(frame)} octets are too short")
    if int.from_bytes(frame[12:14], "big") != ETHERTYPE:
        raise FrameError(f"Ethernet type 0x{frame[12:14].hex()}")
    header = int.from_bytes(frame[14:16], "little")
    at, end = ETHERNET_HEADER + HEADER, ETHERNET_HEADER + HEADER + (header & LENGTH_MASK)
    if header >> 12 != DATAGRAMS_TYPE:
        raise FrameError(f"type {header >> 12} of the EtherCAT header")
    if end > len(frame):
        raise FrameError(f"length {header & LENGTH_MASK} of the EtherCAT header")
    datagrams: list[Datagram] = []
    more = True
    while more:
        if at + OVERHEAD > end:
            raise FrameError(f"datagram {len(datagrams)} is cut")
        command, index, address, length, interrupts = _DATAGRAM.unpack_from(frame, at)
        data_at, octets = at + _DATAGRAM.size, length & LENGTH_MASK
        at = data_at + octets + _COUNTER.size
        if at > end:
            raise FrameError(f"datagram {len(datagrams)} is cut")
        if command not in COMMANDS:
            raise FrameError(f"command {command}")
        datagram = Datagram(command, index, address, frame[data_at : data_at + octets])
        datagram.flags = length & ~(LENGTH_MASK | MORE)
        datagram.interrupts = interrupts
        (datagram.counter,) = _COUNTER.unpack_from(frame, data_at + octets)
        datagrams.append(datagram)
        more = bool(length & MORE)
    return datagrams


def build(
    datagrams: Iterable[Datagram],
    destination: bytes = b"\xff" * 6,
    source: bytes = b"\x02\0\0\0\0\x01",
) -> bytes:
    """Return the Ethernet frame of datagrams, padded to the shortest frame."""
    parts = []
    listed = list(datagrams)
    for number, each in enumerate(listed, start=1):
        length = len(each.data) | each.flags | (MORE if number < len(listed) else 0)
        parts.append(
            _DATAGRAM.pack(each.command, each.index, each.address, length, each.interrupts)
        )
        parts.append(bytes(each.data))
        parts.append(_COUNTER.pack(each.counter & 0xFFFF))
    body = b"".join(parts)
    header = (len(body) | DATAGRAMS_TYPE << 12).to_bytes(2, "little")
    frame = destination + source + ETHERTYPE.to_bytes(2, "big") + header + body
    return frame.ljust(MIN_FRAME, b"\0")


def answer(frame: bytes, datagrams: Iterable[Datagram]) -> bytes:
    """Return a frame as it comes back: with the datagrams as the slaves left them."""
    source = bytes([frame[6] | _SOURCE_CHANGED]) + frame[7:12]
    built = build(datagrams, frame[:6], source)
    return built + frame[len(built) :]
