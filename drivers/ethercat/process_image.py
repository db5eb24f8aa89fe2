"""The places of values in the process data of a segment.

An image has the outputs and inputs of all slaves in one row of bytes, as their FMMUs map them. A
value is an integer of whole bytes at a byte, or a bit.
"""

import struct
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from drivers.cia402.process_data import TYPES, Entry
from drivers.errors import CodecError

TYPE_CODES = TYPES | {"u64": "Q", "i64": "q", "f32": "f", "f64": "d"}
SIZES = {name: struct.calcsize("<" + code) for name, code in TYPE_CODES.items()}


class Area(NamedTuple):
    """The bits of a slave in one direction, as its FMMU maps them."""

    first_bit: int  # from logical address 0
    bits: int


class Values:
    """A run of values in an image, packed without gaps from a byte on."""

    def __init__(self, entries: Sequence[Entry], area: Area) -> None:
        """CodecError for an unknown type, or values that do not fill the area."""
        unknown = [entry.type for entry in entries if entry.type not in TYPE_CODES]
        if unknown:
            raise CodecError("process data", "type", ", ".join(TYPE_CODES), unknown[0])
        bits = 8 * sum(SIZES[entry.type] for entry in entries)
        if area.first_bit % 8 or area.bits != bits:
            given = f"{area.bits} from bit {area.first_bit}"
            raise CodecError("process data", "bits", f"{bits} from a whole byte", given)
        self._packing = struct.Struct("<" + "".join(TYPE_CODES[entry.type] for entry in entries))
        self._at = area.first_bit // 8

    def read(self, image: memoryview) -> tuple[int, ...]:
        """Return the values in the order of the entries."""
        return self._packing.unpack_from(image, self._at)

    def write(self, image: memoryview, *values: int) -> None:
        """Store the values in the order of the entries."""
        self._packing.pack_into(image, self._at, *values)


def read_bit(image: memoryview, bit: int) -> int:
    """Return a bit of an image."""
    return image[bit >> 3] >> (bit & 7) & 1


def write_bit(image: memoryview, bit: int, value: int) -> None:
    """Store a bit of an image; its neighbours stay."""
    mask = 1 << (bit & 7)
    byte = image[bit >> 3]
    image[bit >> 3] = byte | mask if value else byte & ~mask


def image_bytes(areas: Iterable[tuple[Area | None, Area | None]]) -> int:
    """Return the size of an image, 0 without data; ``areas``: outputs and inputs of each slave."""
    ends = [each.first_bit + each.bits for pair in areas for each in pair if each is not None]
    return -(-max(ends, default=0) // 8)


def expected_wkc(areas: Sequence[tuple[Area | None, Area | None]]) -> int:
    """Return the working counter of an LRW: of each slave 1 for inputs and 2 for outputs.

    ``areas``: outputs and inputs of each slave; None for a direction that it lacks.
    """
    return sum(2 * (out is not None) + (into is not None) for out, into in areas)
