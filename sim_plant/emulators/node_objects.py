"""The integer objects of one emulated CANopen node: their values, and who may write them.

The file of a device (EDS) gives types, access, ranges and defaults; texts stay in it.
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


class Refused(canopen.SdoAbortedError):
    """A write that the device answers with an SDO abort code."""


class Kind(NamedTuple):
    """What the object dictionary says of an object."""

    octets: int
    signed: bool
    writable: bool
    mappable: bool
    low: int
    high: int


class Objects:
    """Values by (index, subindex), and what happens when one is written over the bus."""

    def __init__(self, dictionary: canopen.ObjectDictionary) -> None:
        self.kinds: dict[Key, Kind] = {}
        self.values: dict[Key, int] = {}
        self.guards: dict[int, Callable[[Key, int], None]] = {}  # by index; may raise Refused
        self.hooks: dict[Key, Callable[[int], None]] = {}  # after the value is stored
        self.deaf: set[Key] = set()  # writes are acknowledged and lost
        for variable in variables(dictionary):
            if variable.data_type in datatypes.INTEGER_TYPES:
                key = variable.index, variable.subindex
                self.kinds[key] = kind_of(variable)
                self.values[key] = int(variable.default or 0)

    def __getitem__(self, key: Key) -> int:
        return self.values[key]

    def get(self, index: int, subindex: int = 0) -> int:
        """Give a value, 0 if the device has no such object."""
        return self.values.get((index, subindex), 0)

    def put(self, index: int, value: int, subindex: int = 0) -> None:
        """Set a value from inside the device, wrapped to its width; no hook, no guard."""
        key = index, subindex
        kind = self.kinds.get(key)
        if kind is not None:
            inside = kind.low <= value <= kind.high
            self.values[key] = value if inside else wrapped(value, kind)

    def check(self, key: Key, value: int) -> None:
        """Raise Refused if the device does not take a value over the bus."""
        kind = self.kinds[key]
        if not kind.writable:
            raise Refused(READ_ONLY)
        if value > kind.high:
            raise Refused(TOO_HIGH)
        if value < kind.low:
            raise Refused(TOO_LOW)
        guard = self.guards.get(key[0])
        if guard is not None:
            guard(key, value)

    def write(self, key: Key, value: int) -> None:
        """Take a checked value from the bus, and do what follows from it."""
        if key in self.deaf:
            return
        self.values[key] = value
        hook = self.hooks.get(key)
        if hook is not None:
            hook(value)

    def restore(self, values: dict[Key, int], low: int, high: int) -> None:
        """Take the objects of an index range back to other values; no hooks."""
        for key, value in values.items():
            if low <= key[0] <= high:
                self.values[key] = value


@functools.cache
def device_file(eds: Path, node_id: int) -> canopen.ObjectDictionary:
    """Give the object dictionary of a device file, read once; nobody changes it."""
    return canopen.import_od(str(eds), node_id)


def variables(dictionary: canopen.ObjectDictionary) -> Iterator[ODVariable]:
    """Give every variable of a dictionary, subindices too."""
    for entry in dictionary.values():
        if isinstance(entry, ODVariable):
            yield entry
        else:
            yield from entry.values()


def kind_of(variable: ODVariable) -> Kind:
    """Give width, sign, access and range of an integer object."""
    signed = variable.data_type in datatypes.SIGNED_TYPES
    width = len(variable)
    low, high = (-(1 << (width - 1)), (1 << (width - 1)) - 1) if signed else (0, (1 << width) - 1)
    return Kind(
        width // 8,
        signed,
        variable.writable,
        bool(variable.pdo_mappable),
        low if variable.min is None else max(low, variable.min),
        high if variable.max is None else min(high, variable.max),
    )


def rounded(value: float) -> int:
    """Give the nearest integer, 0 for a value that is not finite."""
    return round(value) if math.isfinite(value) else 0


def wrapped(value: int, kind: Kind) -> int:
    """Give a value cut to the object's width, as a register does."""
    width = 8 * kind.octets
    value &= (1 << width) - 1
    if kind.signed and value >> (width - 1):
        value -= 1 << width
    return value
