"""Objects mapped into process data by mapping objects 0x1600.. and 0x1A00.. (CiA 301)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from sim_plant.emulators.device_objects import Key, Objects, SdoRefusedError

FIRST_OBJECT = 0x20  # smaller indices are data types: mapped, they are gaps


class MappedField(NamedTuple):
    """One mapped object in process data."""

    key: Key
    shift: int  # bits
    mask: int
    sign: int  # its sign bit, 0 if it has none


def parse_mapping_entry(value: int) -> tuple[Key, int]:
    """Return the object and the bits of a mapping entry: index 16, subindex 8, length 8 bits."""
    return (value >> 16, (value >> 8) & 0xFF), value & 0xFF


def mapping_entries(objects: Objects, index: int) -> list[tuple[Key, int]]:
    """Return object and bits of the entries of a mapping object as they are set now."""
    subs = range(1, objects.get(index) + 1)
    return [parse_mapping_entry(objects.get(index, sub)) for sub in subs]


def mapped_fields(objects: Objects, indices: Iterable[int]) -> tuple[tuple[MappedField, ...], int]:
    """Return the fields of mapping objects one after the other, and their length in bits."""
    fields, shift = [], 0
    for index in indices:
        for key, width in mapping_entries(objects, index):
            if key[0] >= FIRST_OBJECT and key in objects.types:
                sign = 1 << (width - 1) if objects.types[key].signed else 0
                fields.append(MappedField(key, shift, (1 << width) - 1, sign))
            shift += width
    return tuple(fields), shift


def pack(objects: Objects, fields: Iterable[MappedField], octets: int) -> bytes:
    """Return process data from the objects' values."""
    values, payload = objects.values, 0
    for key, shift, mask, _ in fields:
        payload |= (values[key] & mask) << shift
    return payload.to_bytes(octets, "little")


def unpack(objects: Objects, fields: Iterable[MappedField], data: bytes) -> None:
    """Write the values of process data; a value that the device refuses over SDO is skipped."""
    payload = int.from_bytes(data, "little")
    for key, shift, mask, sign in fields:
        value = (payload >> shift) & mask
        if value & sign:
            value -= mask + 1
        try:
            objects.check(key, value)
        except SdoRefusedError:
            continue
        objects.write(key, value)
