"""Process data of a slave: PDOs assigned in 0x1C12 and 0x1C13, mapped in 0x1600.. and 0x1A00..

The configuration may change in PREOP only, in the order: count 0, entries, count.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from sim_plant.emulators import device_objects, mapped_fields
from sim_plant.emulators.device_objects import (
    UINT8,
    UINT16,
    UINT32,
    Key,
    ObjectEntry,
    Objects,
    SdoRefusedError,
)
from sim_plant.emulators.mapped_fields import MappedField, parse_mapping_entry

RX_ASSIGNMENT, TX_ASSIGNMENT = 0x1C12, 0x1C13
RX_MAPPING, TX_MAPPING, MAPPINGS = 0x1600, 0x1A00, 0x200  # first index of each, and their number
MAX_OCTETS = 512  # of the process data in one direction


def mapping_entry(index: int, subindex: int, bits: int) -> int:
    """Return the value of a mapping entry."""
    return index << 16 | subindex << 8 | bits


def mapping_objects(
    mappings: Mapping[int, tuple[int, ...]], *, slots: int = 0
) -> Iterator[ObjectEntry]:
    """Yield mapping objects with their entries; `slots` > 0: writable, with so many entries."""
    for index, entries in mappings.items():
        name = f"{'RxPDO' if index < TX_MAPPING else 'TxPDO'} mapping 0x{index:04X}"
        writable = slots > 0
        yield ObjectEntry((index, 0), name, "number of entries", UINT8, len(entries), writable)
        for sub in range(1, max(slots, len(entries)) + 1):
            value = entries[sub - 1] if sub <= len(entries) else 0
            yield ObjectEntry((index, sub), name, f"entry {sub}", UINT32, value, writable)


def assignment_objects(
    index: int, assigned: tuple[int, ...], *, slots: int = 0
) -> Iterator[ObjectEntry]:
    """Yield an assignment object with the indices of PDOs; `slots` as of `mapping_objects`."""
    name = "RxPDO assignment" if index == RX_ASSIGNMENT else "TxPDO assignment"
    writable = slots > 0
    yield ObjectEntry((index, 0), name, "number of PDOs", UINT8, len(assigned), writable)
    for sub in range(1, max(slots, len(assigned)) + 1):
        value = assigned[sub - 1] if sub <= len(assigned) else 0
        yield ObjectEntry((index, sub), name, f"PDO {sub}", UINT16, value, writable)


class Direction:
    """The process data of one direction."""

    def __init__(self, objects: Objects, assignment: int) -> None:
        self._objects = objects
        self._assignment = assignment
        self.fields: tuple[MappedField, ...] = ()
        self.octets = 0

    def refresh(self) -> None:
        """Read assignment and mapping."""
        objects = self._objects
        count = objects.get(self._assignment)
        pdos = [objects.get(self._assignment, sub) for sub in range(1, count + 1)]
        self.fields, bits = mapped_fields.mapped_fields(objects, pdos)
        self.octets = (bits + 7) // 8

    def pack(self) -> bytes:
        """Return the data from the objects."""
        return mapped_fields.pack(self._objects, self.fields, self.octets)

    def unpack(self, data: bytes) -> None:
        """Write data to the objects."""
        mapped_fields.unpack(self._objects, self.fields, data[: self.octets])


class ProcessData:
    """Outputs (of the master) and inputs of one slave."""

    def __init__(self, objects: Objects, may_change: Callable[[], bool]) -> None:
        """`may_change`: whether the slave is in PREOP."""
        self.outputs = Direction(objects, RX_ASSIGNMENT)
        self.inputs = Direction(objects, TX_ASSIGNMENT)
        self._objects = objects
        self._may_change = may_change
        for index in {key[0] for key in objects.types}:
            if index in (RX_ASSIGNMENT, TX_ASSIGNMENT):
                objects.guards[index] = self._guard_assignment
            elif RX_MAPPING <= index < RX_MAPPING + MAPPINGS or (
                TX_MAPPING <= index < TX_MAPPING + MAPPINGS
            ):
                objects.guards[index] = self._guard_mapping
        self.refresh()

    def refresh(self) -> None:
        """Read the configuration of both directions."""
        self.outputs.refresh()
        self.inputs.refresh()

    def _check_order(self, key: Key) -> None:
        if not self._may_change() or (key[1] and self._objects.get(key[0])):
            raise SdoRefusedError(device_objects.NOT_IN_THIS_STATE)

    def _guard_assignment(self, key: Key, value: int) -> None:
        self._check_order(key)
        index, sub = key
        if sub:
            first = RX_MAPPING if index == RX_ASSIGNMENT else TX_MAPPING
            known = (value, 0) in self._objects.types
            if not (known and first <= value < first + MAPPINGS):
                raise SdoRefusedError(device_objects.BAD_VALUE)
        elif (index, value) not in self._objects.types:
            raise SdoRefusedError(device_objects.TOO_HIGH)
        else:
            assigned = [self._objects.get(index, each) for each in range(1, value + 1)]
            if 0 in assigned:
                raise SdoRefusedError(device_objects.BAD_VALUE)
            _, bits = mapped_fields.mapped_fields(self._objects, assigned)
            if bits > 8 * MAX_OCTETS:
                raise SdoRefusedError(device_objects.TOO_LONG_FOR_PDO)

    def _guard_mapping(self, key: Key, value: int) -> None:
        self._check_order(key)
        index, sub = key
        if not sub:
            if (index, value) not in self._objects.types:
                raise SdoRefusedError(device_objects.TOO_HIGH)
            return
        mapped, bits = parse_mapping_entry(value)
        if mapped[0] < mapped_fields.FIRST_OBJECT:
            return  # a gap
        type_ = self._objects.types.get(mapped)
        is_fit = type_ is not None and type_.mappable and bits == type_.bits
        if not is_fit or (index < TX_MAPPING and type_ is not None and not type_.writable):
            raise SdoRefusedError(device_objects.NOT_MAPPABLE)
