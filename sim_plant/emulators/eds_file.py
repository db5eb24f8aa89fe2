"""The objects of a CANopen device file (EDS)."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from pathlib import Path

import canopen
from canopen.objectdictionary import ODVariable

from sim_plant.emulators.device_objects import ObjectEntry


@functools.cache
def load_dictionary(eds: Path, node_id: int) -> canopen.ObjectDictionary:
    """Return the object dictionary of a device file, read once; it must not be changed."""
    return canopen.import_od(str(eds), node_id)


def load_entries(eds: Path, node_id: int = 0) -> tuple[ObjectEntry, ...]:
    """Return the objects of a device file, subindex by subindex."""
    return tuple(_entries(load_dictionary(eds, node_id)))


def _entries(dictionary: canopen.ObjectDictionary) -> Iterator[ObjectEntry]:
    for entry in dictionary.values():
        variables = [entry] if isinstance(entry, ODVariable) else entry.values()
        for each in variables:
            default = each.default
            yield ObjectEntry(
                (each.index, each.subindex),
                entry.name,
                each.name,
                each.data_type or 0,
                default if isinstance(default, int | str) else 0,
                each.writable,
                bool(each.pdo_mappable),
                each.min,
                each.max,
            )
