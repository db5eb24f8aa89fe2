"""The objects of one emulated device: values and access rules, for CANopen and for CoE.

Integers have values that change; texts keep their default.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple

Key = tuple[int, int]  # index, subindex

# SDO abort codes (CiA 301)
READ_ONLY = 0x06010002
NOT_MAPPABLE = 0x06040041
TOO_LONG_FOR_PDO = 0x06040042
INCOMPATIBLE = 0x06040043
BAD_VALUE = 0x06090030
TOO_HIGH = 0x06090031
TOO_LOW = 0x06090032
NOT_STORED = 0x08000020
NOT_IN_THIS_STATE = 0x08000022

# Data types (CiA 301): bits by code
UNSIGNED = {0x01: 1, 0x05: 8, 0x06: 16, 0x07: 32, 0x16: 24, 0x18: 40, 0x19: 48, 0x1A: 56, 0x1B: 64}
SIGNED = {0x02: 8, 0x03: 16, 0x04: 32, 0x10: 24, 0x12: 40, 0x13: 48, 0x14: 56, 0x15: 64}
WIDTHS = {**UNSIGNED, **SIGNED}
BOOLEAN, INT16, INT32 = 0x01, 0x03, 0x04
UINT8, UINT16, UINT32, UINT64 = 0x05, 0x06, 0x07, 0x1B
VISIBLE_STRING = 0x09


class SdoRefusedError(Exception):
    """A write that the device answers with an SDO abort code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"SDO abort 0x{code:08X}")
        self.code = code


class ObjectEntry(NamedTuple):
    """One subindex of an object dictionary."""

    key: Key
    object_name: str  # of the index
    name: str
    data_type: int  # CiA 301
    default: int | str = 0
    writable: bool = False
    mappable: bool = False
    low: int | None = None  # None: that of its type
    high: int | None = None


class ObjectType(NamedTuple):
    """Type of an integer object."""

    bits: int
    signed: bool
    writable: bool
    mappable: bool
    low: int
    high: int


class Objects:
    """Values by (index, subindex), with guards and hooks for writes over the bus."""

    def __init__(self, entries: Iterable[ObjectEntry]) -> None:
        self.entries = {entry.key: entry for entry in entries}
        self.types: dict[Key, ObjectType] = {}
        self.values: dict[Key, int] = {}
        self.guards: dict[
            int, Callable[[Key, int], None]
        ] = {}  # by index; may raise SdoRefusedError
        self.hooks: dict[Key, Callable[[int], None]] = {}  # after the value is stored
        self.ignored: set[Key] = set()  # writes are acknowledged and ignored
        for key, entry in self.entries.items():
            if entry.data_type in WIDTHS:
                self.types[key] = object_type(entry)
                self.values[key] = int(entry.default or 0)

    def __getitem__(self, key: Key) -> int:
        return self.values[key]

    def get(self, index: int, subindex: int = 0) -> int:
        """Return a value, 0 if the device has no such object."""
        return self.values.get((index, subindex), 0)

    def put(self, index: int, value: int, subindex: int = 0) -> None:
        """Set a value from inside the device, wrapped to its width, without hook or guard."""
        key = index, subindex
        type_ = self.types.get(key)
        if type_ is not None:
            in_range = type_.low <= value <= type_.high
            self.values[key] = value if in_range else wrap_to_width(value, type_)

    def check(self, key: Key, value: int) -> None:
        """Raise SdoRefusedError if the device does not accept a value over the bus."""
        type_ = self.types[key]
        if not type_.writable:
            raise SdoRefusedError(READ_ONLY)
        if value > type_.high:
            raise SdoRefusedError(TOO_HIGH)
        if value < type_.low:
            raise SdoRefusedError(TOO_LOW)
        guard = self.guards.get(key[0])
        if guard is not None:
            guard(key, value)

    def write(self, key: Key, value: int) -> None:
        """Store a checked value from the bus and call its hook."""
        if key in self.ignored:
            return
        self.values[key] = value
        hook = self.hooks.get(key)
        if hook is not None:
            hook(value)

    def restore(self, values: dict[Key, int], low: int, high: int) -> None:
        """Set the objects of an index range to other values, without hooks."""
        for key, value in values.items():
            if low <= key[0] <= high:
                self.values[key] = value


def object_type(entry: ObjectEntry) -> ObjectType:
    """Return width, sign, access and range of an integer object."""
    bits, signed = WIDTHS[entry.data_type], entry.data_type in SIGNED
    low, high = (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if signed else (0, (1 << bits) - 1)
    return ObjectType(
        bits,
        signed,
        entry.writable,
        entry.mappable,
        low if entry.low is None else max(low, entry.low),
        high if entry.high is None else min(high, entry.high),
    )


def round_or_zero(value: float) -> int:
    """Return the nearest integer, 0 for a value that is not finite."""
    return round(value) if math.isfinite(value) else 0


def wrap_to_width(value: int, type_: ObjectType) -> int:
    """Return a value wrapped to the object's width, like a register."""
    width = type_.bits
    value &= (1 << width) - 1
    if type_.signed and value >> (width - 1):
        value -= 1 << width
    return value
