"""Registers of a Modbus device: what they mean, said once as data, decoded and encoded.

Modbus transports 16-bit registers, high byte first; how two of them make a 32-bit number differs
between makers (Yokogawa WT300E: upper word first, MW100: lower word first), so the word order is
configuration. A float in the wrong order is mostly absurdly large or small, which `implausible`
tells.
"""

import math
import struct
from collections.abc import Sequence
from typing import NamedTuple

from drivers.errors import CodecError

TABLES = ("coil", "discrete", "input", "holding")  # the four address spaces
BITS = ("coil", "discrete")
# Modbus Application Protocol V1.1b3: at most 125 registers and 2000 bits in one read.
MOST = {"coil": 2000, "discrete": 2000, "input": 125, "holding": 125}
REGISTERS = {"bit": 1, "u16": 1, "i16": 1, "u32": 2, "i32": 2, "f32": 2}
_CODES = {"u16": "H", "i16": "h", "u32": "I", "i32": "i", "f32": "f"}


class Value(NamedTuple):
    """One value of a device."""

    name: str
    at: int  # registers (or bits) from the first of its block
    kind: str  # a key of REGISTERS
    scale: float  # our unit per step of the device
    low: float  # in our unit: what can be at all; outside it is not believed
    high: float


class Block(NamedTuple):
    """Registers that are read or written in one request."""

    unit: int  # Modbus unit (device) number
    table: str  # one of TABLES
    first: int  # address, from 0
    size: int  # registers, or bits
    values: tuple[Value, ...]


class MapError(ValueError):
    """A register map that cannot be; names block and value."""


def checked(block: Block) -> Block:
    """The block, or MapError naming what is wrong with it."""
    where = f"unit {block.unit}, {block.table} {block.first}"
    if block.table not in TABLES:
        raise MapError(f"{where}: no table {block.table!r}, there are {', '.join(TABLES)}")
    if not 0 <= block.unit <= 247:
        raise MapError(f"{where}: unit numbers are 0 to 247")
    if not (1 <= block.size <= MOST[block.table] and 0 <= block.first <= 0x10000 - block.size):
        raise MapError(f"{where}: {block.size} of them cannot be read at once")
    for value in block.values:
        if value.kind not in REGISTERS or (value.kind == "bit") != (block.table in BITS):
            raise MapError(f"{where}: {value.name}: no {value.kind!r} in {block.table}")
        if not 0 <= value.at <= block.size - REGISTERS[value.kind]:
            raise MapError(f"{where}: {value.name} lies outside the block")
        if not (math.isfinite(value.scale) and value.scale != 0.0 and value.low <= value.high):
            raise MapError(f"{where}: {value.name}: scale {value.scale}, {value.low}..{value.high}")
    return block


def decode(block: Block, registers: Sequence[int], high_first: bool) -> tuple[float, ...]:
    """The values of a block in our units, in its order; NaN stays NaN.

    CodecError if there are not exactly as many registers as asked for, or one is no 16-bit number.
    """
    where = f"{block.table} {block.first}"
    if len(registers) != block.size:
        raise CodecError(
            f"unit {block.unit}", where, f"{block.size} registers", f"{len(registers)}"
        )
    for register in registers:
        if not 0 <= register <= 0xFFFF:
            raise CodecError(f"unit {block.unit}", where, "16-bit registers", register)
    return tuple(_decode(value, registers, high_first) * value.scale for value in block.values)


def _decode(value: Value, registers: Sequence[int], high_first: bool) -> float:
    if value.kind == "bit":
        return float(registers[value.at] & 1)
    words = registers[value.at : value.at + REGISTERS[value.kind]]
    if not high_first:
        words = words[::-1]
    raw = b"".join(word.to_bytes(2, "big") for word in words)
    return float(struct.unpack(">" + _CODES[value.kind], raw)[0])


def encode(block: Block, wanted: Sequence[float], high_first: bool) -> list[int]:
    """The registers that carry these values, 0 where the block has none.

    CodecError for a value that is not finite, out of its range, or does not fit its registers.
    """
    registers = [0] * block.size
    for value, number in zip(block.values, wanted, strict=True):
        if not value.low <= number <= value.high:
            bounds = f"{value.low:g} to {value.high:g}"
            raise CodecError(f"unit {block.unit}", value.name, bounds, number)
        raw: float = number / value.scale
        if value.kind == "bit":
            registers[value.at] = 1 if raw else 0
            continue
        try:
            packed = struct.pack(
                ">" + _CODES[value.kind], raw if value.kind == "f32" else round(raw)
            )
        except (struct.error, OverflowError):
            raise CodecError(f"unit {block.unit}", value.name, value.kind, raw) from None
        words = [int.from_bytes(packed[i : i + 2], "big") for i in range(0, len(packed), 2)]
        registers[value.at : value.at + len(words)] = words if high_first else words[::-1]
    return registers


def implausible(block: Block, values: Sequence[float]) -> tuple[str, ...]:
    """Names of the values that cannot be: outside their range or no number."""
    return tuple(
        value.name
        for value, number in zip(block.values, values, strict=True)
        if not value.low <= number <= value.high
    )
