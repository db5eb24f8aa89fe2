"""The objects that drives exchange every cycle, on any wire: types, entries, mapping."""

import struct
from typing import NamedTuple

# CiA 301 basic types by struct code.
TYPES = {"u8": "B", "i8": "b", "u16": "H", "i16": "h", "u32": "I", "i32": "i"}
BYTES = {name: struct.calcsize("<" + code) for name, code in TYPES.items()}


class Entry(NamedTuple):
    """One object in a PDO."""

    object: int  # index in the object dictionary
    sub: int
    type: str  # a key of TYPES
    name: str


CONTROLWORD = Entry(0x6040, 0, "u16", "controlword")
STATUSWORD = Entry(0x6041, 0, "u16", "statusword")
MODE = Entry(0x6060, 0, "i8", "mode of operation")
MODE_DISPLAY = Entry(0x6061, 0, "i8", "mode of operation display")
POSITION = Entry(0x6064, 0, "i32", "position actual value")
TARGET_TORQUE = Entry(0x6071, 0, "i16", "target torque")
TORQUE = Entry(0x6077, 0, "i16", "torque actual value")
TARGET_POSITION = Entry(0x607A, 0, "i32", "target position")
PROFILE_VELOCITY = Entry(0x6081, 0, "u32", "profile velocity")
ERROR_CODE = Entry(0x603F, 0, "u16", "error code")
ANALOG_INPUTS = tuple(Entry(0x201A, sub, "i16", f"analog input {sub}") for sub in (1, 2, 3, 4))


def to_bytes(kind: str, value: int) -> bytes:
    """Return the bytes of an integer of a type, low byte first."""
    return value.to_bytes(BYTES[kind], "little", signed=kind[0] == "i")


def from_bytes(kind: str, data: bytes) -> int | None:
    """Return the integer of a type; None for another number of bytes."""
    whole = len(data) == BYTES[kind]
    return int.from_bytes(data, "little", signed=kind[0] == "i") if whole else None


def mapping_entries(entries: tuple[Entry, ...]) -> tuple[int, ...]:
    """Return the u32 of each sub-index of a mapping object (0x1600, 0x1A00): index, sub, bits."""
    return tuple(e.object << 16 | e.sub << 8 | 8 * BYTES[e.type] for e in entries)
