"""The integer objects of one emulated CANopen node: values and access rules.

The device file (EDS) defines types, access, ranges and defaults; strings are not copied from it.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import canopen
from canopen.objectdictionary import ODVariable, datatypes

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


class SdoRefusedError(canopen.SdoAbortedError):
    """A write that the device answers with an SDO abort code."""


class ObjectType(NamedTuple):
    """Type of an object in the object dictionary."""

    octets: int
    signed: bool
    writable: bool
    mappable: bool
    low: int
    high: int


class Objects:
    """Values by (index, subindex), with guards and hooks for writes over the bus."""

    def __init__(self, dictionary: canopen.ObjectDictionary) -> None:
        self.types: dict[Key, ObjectType] = {}
        self.values: dict[Key, int] = {}
        self.guards: dict[
            int, Callable[[Key, int], None]
        ] = {}  # by index; may raise SdoRefusedError
        self.hooks: dict[Key, Callable[[int], None]] = {}  # after the value is stored
        self.ignored: set[Key] = set()  # writes are acknowledged and ignored
        for variable in variables(dictionary):
            if variable.data_type in datatypes.INTEGER_TYPES:
                key = variable.index, variable.subindex
                self.types[key] = object_type(variable)
                self.values[key] = int(variable.default or 0)

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


@functools.cache
def load_dictionary(eds: Path, node_id: int) -> canopen.ObjectDictionary:
    """Return the object dictionary of a device file, read once; it must not be changed."""
    return canopen.import_od(str(eds), node_id)


def variables(dictionary: canopen.ObjectDictionary) -> Iterator[ODVariable]:
    """Yield every variable of a dictionary, including subindices."""
    for entry in dictionary.values():
        if isinstance(entry, ODVariable):
            yield entry
        else:
            yield from entry.values()


def object_type(variable: ODVariable) -> ObjectType:
    """Return width, sign, access and range of an integer object."""
    signed = variable.data_type in datatypes.SIGNED_TYPES
    width = len(variable)
    low, high = (-(1 << (width - 1)), (1 << (width - 1)) - 1) if signed else (0, (1 << width) - 1)
    return ObjectType(
        width // 8,
        signed,
        variable.writable,
        bool(variable.pdo_mappable),
        low if variable.min is None else max(low, variable.min),
        high if variable.max is None else min(high, variable.max),
    )


def round_or_zero(value: float) -> int:
    """Return the nearest integer, 0 for a value that is not finite."""
    return round(value) if math.isfinite(value) else 0


def wrap_to_width(value: int, type_: ObjectType) -> int:
    """Return a value wrapped to the object's width, like a register."""
    width = 8 * type_.octets
    value &= (1 << width) - 1
    if type_.signed and value >> (width - 1):
        value -= 1 << width
    return value
