"""The values of a terminal in the images of its segment: bits, numbers, means of several samples.

A terminal's process data are its PDOs one behind the other, each value where the one before ends.
"""

import struct
import sys
from collections.abc import Callable, Iterable
from math import isnan
from typing import NamedTuple

from drivers.errors import CodecError
from drivers.ethercat.process_image import SIZES, TYPE_CODES, Area, read_bit, write_bit

_LARGEST = {"f32": (2.0 - 2.0**-23) * 2.0**127, "f64": sys.float_info.max}


class TerminalEntry(NamedTuple):
    """One value of the process data, or several of one type in a row."""

    name: str  # empty: a gap
    type: str  # "bit", or a type of `process_image`
    number: int = 1
    invalid_mask: int = 0  # bits of a status with which the terminal's inputs are wrong

    @property
    def bits(self) -> int:
        """The bits that it takes."""
        return self.number * (1 if self.type == "bit" else 8 * SIZES[self.type])


class Place(NamedTuple):
    """Place of a value in an image."""

    first_bit: int
    type: str
    number: int = 1


def places(entries: Iterable[TerminalEntry], area: Area | None) -> dict[str, Place]:
    """Return the place of each named value; ``area``: of the slave in this direction.

    CodecError if the entries do not fill the area, which may be padded to whole bytes: the slave
    has another mapping than the described one.
    """
    found: dict[str, Place] = {}
    at = 0
    for entry in entries:
        if entry.name:
            found[entry.name] = Place(
                (area.first_bit if area else 0) + at, entry.type, entry.number
            )
        at += entry.bits
    given = area.bits if area else 0
    if not at <= given <= -(-at // 8) * 8:
        raise CodecError("process data", "bits", f"{at}", given)
    for name, place in found.items():
        if place.type != "bit" and place.first_bit % 8:
            raise CodecError("process data", name, "a whole byte", f"bit {place.first_bit}")
    return found


def reader(place: Place) -> Callable[[memoryview], float]:
    """Return the function that reads a value from an image; of several their mean."""
    first, kind, number = place
    if kind == "bit" and number == 1:
        return lambda image: read_bit(image, first)
    if kind == "bit":
        bits = range(first, first + number)
        return lambda image: sum(read_bit(image, bit) for bit in bits) / number
    unpack, at = struct.Struct(f"<{number}{TYPE_CODES[kind]}").unpack_from, first // 8
    if number == 1:
        return lambda image: unpack(image, at)[0]
    return lambda image: sum(unpack(image, at)) / number


def writer(place: Place) -> Callable[[memoryview, float], None]:
    """Return the function that stores a value in an image, in each of several.

    Numbers are clamped and rounded; a value that is no number stores 0.
    """
    first, kind, number = place
    if kind == "bit":
        bits = range(first, first + number)

        def write_bits(image: memoryview, value: float) -> None:
            for bit in bits:
                write_bit(image, bit, 0 if isnan(value) or not value else 1)

        return write_bits
    pack, at = struct.Struct(f"<{number}{TYPE_CODES[kind]}").pack_into, first // 8
    low, high = _range(kind)
    is_whole = kind[0] != "f"

    def write(image: memoryview, value: float) -> None:
        stored = max(low, min(high, value)) if not isnan(value) else 0
        pack(image, at, *(round(stored) if is_whole else stored,) * number)

    return write


def _range(kind: str) -> tuple[float, float]:
    """Return the range of a type of numbers."""
    if kind[0] == "f":
        largest = _LARGEST[kind]
        return -largest, largest
    bits = 8 * SIZES[kind]
    return (-(1 << bits - 1), (1 << bits - 1) - 1) if kind[0] == "i" else (0, (1 << bits) - 1)
