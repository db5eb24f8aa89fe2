"""Process data of an emulated node: mapping and communication parameters as written over SDO.

CiA 301. RPDO n: 0x1400+n, 0x1600+n; TPDO n: 0x1800+n, 0x1A00+n. A COB-ID with bit 31 disables the
PDO. Types: 0 with SYNC after a change, 1..240 with every n-th SYNC, 254 and 255 by event.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from sim_plant.emulators import device_objects, mapped_fields
from sim_plant.emulators.device_objects import Key, Objects, SdoRefusedError
from sim_plant.emulators.mapped_fields import FIRST_OBJECT, MappedField, parse_mapping_entry
from sim_plant.units import Second

OFF = 1 << 31
MAX_PDO_BITS = 64  # bits


class PdoMap(NamedTuple):
    """Present configuration of one PDO."""

    number: int  # from 0
    cob_id: int
    type: int
    fields: tuple[MappedField, ...]
    octets: int
    inhibit: Second
    timer: Second  # event timer; of an RPDO its deadline; 0: none


class Pdos:
    """All PDOs of a node."""

    def __init__(self, objects: Objects, operational: Callable[[], bool]) -> None:
        self.receive: dict[int, PdoMap] = {}  # by COB-ID
        self.transmit: list[PdoMap] = []
        self._objects = objects
        self._operational = operational
        self.stale = True  # the configuration was written after it was read
        types = objects.types
        for base in (0x1400, 0x1800):
            for number in (n for n in range(64) if (base + n, 1) in types):
                objects.guards[base + number] = self._guard_communication
                objects.guards[base + 0x200 + number] = self._guard_mapping
                for index in (base + number, base + 0x200 + number):
                    for sub in (s for s in range(65) if (index, s) in types):
                        objects.hooks[index, sub] = self._changed

    def refresh(self) -> bool:
        """Read the configuration if it was written since; return whether it was."""
        if not self.stale:
            return False
        self.stale = False
        self.receive = {map_.cob_id: map_ for map_ in self._maps(0x1400)}
        self.transmit = self._maps(0x1800)
        return True

    def invalidate(self) -> None:
        """Mark the configuration to be read at the next use."""
        self.stale = True

    def pack(self, map_: PdoMap) -> bytes:
        """Return the data of a PDO from the objects' values."""
        return mapped_fields.pack(self._objects, map_.fields, map_.octets)

    def unpack(self, map_: PdoMap, data: bytes) -> None:
        """Write the values of a PDO; a value that the device refuses over SDO is skipped."""
        mapped_fields.unpack(self._objects, map_.fields, data)

    def _changed(self, value: int) -> None:
        self.stale = True

    def _maps(self, base: int) -> list[PdoMap]:
        numbers = (n for n in range(64) if (base + n, 1) in self._objects.types)
        maps = (self._map(base, number) for number in numbers)
        return [map_ for map_ in maps if map_ is not None]

    def _map(self, base: int, number: int) -> PdoMap | None:
        objects = self._objects
        cob_id = objects.get(base + number, 1)
        if cob_id & OFF:
            return None
        fields, width = mapped_fields.mapped_fields(objects, [base + 0x200 + number])
        return PdoMap(
            number,
            cob_id & 0x7FF,
            objects.get(base + number, 2),
            fields,
            (width + 7) // 8,
            objects.get(base + number, 3) * 1.0e-4,
            objects.get(base + number, 5) * 1.0e-3,
        )

    def _guard_communication(self, key: Key, value: int) -> None:
        index, sub = key
        old_cob_id = self._objects.get(index, 1)
        if sub == 1 and not old_cob_id & OFF and not value & OFF and (old_cob_id ^ value) & 0x7FF:
            raise SdoRefusedError(device_objects.BAD_VALUE)  # it must be disabled first
        if sub == 2 and 240 < value < 254:
            raise SdoRefusedError(device_objects.BAD_VALUE)
        if sub == 3 and not old_cob_id & OFF and value != self._objects.get(index, 3):
            raise SdoRefusedError(device_objects.NOT_IN_THIS_STATE)

    def _guard_mapping(self, key: Key, value: int) -> None:
        """Allow mapping writes in PRE-OPERATIONAL, in the order disable, 0, entries, count."""
        index, sub = key
        objects = self._objects
        if self._operational() or not objects.get(index - 0x200, 1) & OFF:
            raise SdoRefusedError(device_objects.NOT_IN_THIS_STATE)
        if sub == 0:
            entries = [parse_mapping_entry(objects.get(index, s)) for s in range(1, value + 1)]
            if sum(width for _, width in entries) > MAX_PDO_BITS:
                raise SdoRefusedError(device_objects.TOO_LONG_FOR_PDO)
            return
        if objects.get(index) != 0:
            raise SdoRefusedError(device_objects.NOT_IN_THIS_STATE)
        mapped, width = parse_mapping_entry(value)
        type_ = objects.types.get(mapped)
        if value == 0 or 0 < mapped[0] < FIRST_OBJECT:
            return
        if type_ is None or not type_.mappable or width != type_.bits:
            raise SdoRefusedError(device_objects.NOT_MAPPABLE)
        if index < 0x1800 and not type_.writable:
            raise SdoRefusedError(device_objects.NOT_MAPPABLE)
