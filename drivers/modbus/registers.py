"""Register maps of Modbus devices as data, with decoding and encoding of their values.

Modbus transports 16-bit registers, high byte first. How two of them form a 32-bit number differs
between manufacturers (Yokogawa WT300E: upper word first, MW100: lower word first), so the word
order is configuration. A float in the wrong order is mostly far too large or too small, which
`implausible_values` reports.
"""

import math
import struct
from collections.abc import Sequence
from typing import NamedTuple

from drivers.errors import CodecError

TABLES = ("coil", "discrete", "input", "holding")  # the four address spaces
BIT_TABLES = ("coil", "discrete")
# Modbus Application Protocol V1.1b3: at most 125 registers and 2000 bits in one read.
MAX_SIZE = {"coil": 2000, "discrete": 2000, "input": 125, "holding": 125}
REGISTER_COUNT = {"bit": 1, "u16": 1, "i16": 1, "u32": 2, "i32": 2, "f32": 2}
_STRUCT_CODES = {"u16": "H", "i16": "h", "u32": "I", "i32": "i", "f32": "f"}


class RegisterValue(NamedTuple):
    """One value of a device."""

    name: str
    offset: int  # registers (or bits) from the first of its block
    kind: str  # a key of REGISTERS
    scale: float  # SI unit per step of the device
    low: float  # plausible range, in the SI unit; a value outside it is implausible
    high: float


class RegisterBlock(NamedTuple):
    """Consecutive registers that one request reads or writes."""

    unit: int  # Modbus unit (device) number
    table: str  # one of TABLES
    first: int  # address, from 0
    size: int  # registers, or bits
    values: tuple[RegisterValue, ...]


class RegisterMapError(ValueError):
    """An invalid register map; names block and value."""


def validated(block: RegisterBlock) -> RegisterBlock:
    """Return the block if it is valid; else raise RegisterMapError."""
    where = f"unit {block.unit}, {block.table} {block.first}"
    if block.table not in TABLES:
        raise RegisterMapError(f"{where}: no table {block.table!r}, there are {', '.join(TABLES)}")
    if not 0 <= block.unit <= 247:
        raise RegisterMapError(f"{where}: unit numbers are 0 to 247")
    if not (1 <= block.size <= MAX_SIZE[block.table] and 0 <= block.first <= 0x10000 - block.size):
        raise RegisterMapError(f"{where}: {block.size} of them cannot be read at once")
    for value in block.values:
        if value.kind not in REGISTER_COUNT or (value.kind == "bit") != (block.table in BIT_TABLES):
            raise RegisterMapError(f"{where}: {value.name}: no {value.kind!r} in {block.table}")
        if not 0 <= value.offset <= block.size - REGISTER_COUNT[value.kind]:
            raise RegisterMapError(f"{where}: {value.name} lies outside the block")
        if not (math.isfinite(value.scale) and value.scale != 0.0 and value.low <= value.high):
            raise RegisterMapError(
                f"{where}: {value.name}: scale {value.scale}, {value.low}..{value.high}"
            )
    return block


def decode(
    block: RegisterBlock, registers: Sequence[int], high_word_first: bool
) -> tuple[float, ...]:
    """Return the values of a block in its order and in SI units; NaN stays NaN.

    CodecError unless there are exactly ``block.size`` registers, each a 16-bit number.
    """
    where = f"{block.table} {block.first}"
    if len(registers) != block.size:
        raise CodecError(
            f"unit {block.unit}", where, f"{block.size} registers", f"{len(registers)}"
        )
    for register in registers:
        if not 0 <= register <= 0xFFFF:
            raise CodecError(f"unit {block.unit}", where, "16-bit registers", register)
    return tuple(_decode(value, registers, high_word_first) * value.scale for value in block.values)


def _decode(value: RegisterValue, registers: Sequence[int], high_word_first: bool) -> float:
    if value.kind == "bit":
        return float(registers[value.offset] & 1)
    parts = registers[value.offset : value.offset + REGISTER_COUNT[value.kind]]
    if not high_word_first:
        parts = parts[::-1]
    raw = b"".join(word.to_bytes(2, "big") for word in parts)
    return float(struct.unpack(">" + _STRUCT_CODES[value.kind], raw)[0])


def encode(block: RegisterBlock, numbers: Sequence[float], high_word_first: bool) -> list[int]:
    """Return the registers that carry these values, 0 where the block defines none.

    CodecError for a value that is not finite, out of its range, or does not fit its registers.
    """
    registers = [0] * block.size
    for value, number in zip(block.values, numbers, strict=True):
        if not value.low <= number <= value.high:
            bounds = f"{value.low:g} to {value.high:g}"
            raise CodecError(f"unit {block.unit}", value.name, bounds, number)
        raw: float = number / value.scale
        if value.kind == "bit":
            registers[value.offset] = 1 if raw else 0
            continue
        try:
            packed = struct.pack(
                ">" + _STRUCT_CODES[value.kind], raw if value.kind == "f32" else round(raw)
            )
        except (struct.error, OverflowError):
            raise CodecError(f"unit {block.unit}", value.name, value.kind, raw) from None
        parts = [int.from_bytes(packed[i : i + 2], "big") for i in range(0, len(packed), 2)]
        registers[value.offset : value.offset + len(parts)] = (
            parts if high_word_first else parts[::-1]
        )
    return registers


def implausible_values(block: RegisterBlock, values: Sequence[float]) -> tuple[str, ...]:
    """Return the names of the values that are outside their range or NaN."""
    return tuple(
        value.name
        for value, number in zip(block.values, values, strict=True)
        if not value.low <= number <= value.high
    )


def implausible_hint(values: Sequence[float]) -> str:
    """Return the likely cause of implausible values: of a NaN, the device has no measurement."""
    return "no number" if any(map(math.isnan, values)) else "swapped words?"
