"""Fieldbus memory management units: logical addresses of a datagram to memory, bit by bit."""

from __future__ import annotations

import struct
from typing import NamedTuple, Protocol

REGISTERS = 16  # octets of one unit
_FORM = struct.Struct("<IHBBHBBB")
READ, WRITE = 1, 2  # types


class Memory(Protocol):
    """The memory behind a unit."""

    def read(self, address: int, length: int) -> bytes | None:
        """Return what the master reads; None if the access is refused."""
        ...

    def write(self, address: int, data: bytes) -> bool:
        """Take what the master writes; return False if the access is refused."""
        ...

    def write_bits(self, address: int, value: int, mask: int) -> bool:
        """Take single bits; return False if the access is refused."""
        ...


class Piece(NamedTuple):
    """The part of a datagram that one unit maps."""

    kind: int  # READ, WRITE or both
    octet: int  # of the datagram
    octets: int  # 0: bits
    address: int  # physical
    bit: int = 0  # first bit in the datagram's octet
    bits: int = 0
    physical_bit: int = 0


def units(registers: bytes) -> list[tuple[int, ...]]:
    """Return the active units of a copy of the registers."""
    parsed = (_FORM.unpack_from(registers, at) for at in range(0, len(registers), REGISTERS))
    return [unit for unit in parsed if unit[7] & 1 and unit[1]]


def pieces(registers: bytes, logical: int, length: int) -> list[Piece]:
    """Return what the units map of a datagram with a logical address and a length in octets.

    A unit maps a string of bits: from its start bit in the first octet to its end bit in the last.
    """
    found = []
    for start, octets, start_bit, end_bit, address, physical_bit, kind, _ in units(registers):
        first = max(start * 8 + start_bit, logical * 8)
        end = min((start + octets - 1) * 8 + end_bit + 1, (logical + length) * 8)
        if first >= end:
            continue
        physical = address * 8 + physical_bit + first - (start * 8 + start_bit)
        relative = first - logical * 8
        if not (relative % 8 or physical % 8 or (end - first) % 8):
            found.append(Piece(kind, relative // 8, (end - first) // 8, physical // 8))
        else:
            found.append(
                Piece(
                    kind,
                    relative // 8,
                    0,
                    physical // 8,
                    relative % 8,
                    end - first,
                    physical % 8,
                )
            )
    return found


def write_piece(memory: Memory, piece: Piece, data: bytearray) -> bool:
    """Write the part of a datagram to memory; return whether it was accepted."""
    _, octet, octets, address, bit, bits, physical_bit = piece
    if octets:
        return memory.write(address, bytes(data[octet : octet + octets]))
    mask = (1 << bits) - 1
    source = int.from_bytes(data[octet : octet + (bit + bits + 7) // 8], "little")
    return memory.write_bits(address, (source >> bit & mask) << physical_bit, mask << physical_bit)


def read_piece(memory: Memory, piece: Piece, data: bytearray) -> bool:
    """Read memory into the part of a datagram; return whether it was accepted."""
    _, octet, octets, address, bit, bits, physical_bit = piece
    if octets:
        got = memory.read(address, octets)
        if got is not None:
            data[octet : octet + octets] = got
        return got is not None
    got = memory.read(address, (physical_bit + bits + 7) // 8)
    if got is None:
        return False
    span = (bit + bits + 7) // 8
    mask = (1 << bits) - 1
    value = int.from_bytes(got, "little") >> physical_bit & mask
    old = int.from_bytes(data[octet : octet + span], "little")
    data[octet : octet + span] = (old & ~(mask << bit) | value << bit).to_bytes(span, "little")
    return True
