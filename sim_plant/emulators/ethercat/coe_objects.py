"""Objects that every slave with CoE has, and those that make a drive's body a CoE drive."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from sim_plant.emulators.device_objects import (
    BOOLEAN,
    UINT8,
    UINT16,
    UINT32,
    VISIBLE_STRING,
    ObjectEntry,
)
from sim_plant.emulators.ethercat.process_data import (
    RX_ASSIGNMENT,
    TX_ASSIGNMENT,
    assignment_objects,
    mapping_objects,
)
from sim_plant.emulators.ethercat.sii import Identity

FREE_RUN, WITH_OUTPUTS, WITH_SYNC0, INPUTS_WITH_OUTPUTS = 0, 1, 2, 0x22  # 0x1C32:01, 0x1C33:01
SUPPORTED, ONLY_SYNC0 = 0x0007, 0x0004  # 0x1C32:04: free run, with sync manager, with SYNC0
KEPT = {0x1000, 0x1001, 0x1003, 0x1010, 0x1011}  # of a CANopen device's communication area
FIRST_OF_DEVICE = 0x2000


class Mappings(NamedTuple):
    """Default process data of a drive."""

    rx: Mapping[int, tuple[int, ...]]
    tx: Mapping[int, tuple[int, ...]]
    rx_assigned: tuple[int, ...]
    tx_assigned: tuple[int, ...]
    slots: int = 32  # entries that a mapping may have


def slave_objects(
    identity: Identity, name: str, cycle_ns: int = 1_000_000, *, needs_sync0: bool = False
) -> Iterator[ObjectEntry]:
    """Yield device name, identity, types of sync managers and their synchronisation.

    `needs_sync0`: the slave works with SYNC0 only.
    """
    for index, title, text in (
        (0x1008, "device name", name),
        (0x1009, "hardware version", "1"),
        (0x100A, "software version", "1"),
    ):
        yield ObjectEntry((index, 0), title, title, VISIBLE_STRING, text)
    yield ObjectEntry((0x1018, 0), "identity", "number of entries", UINT8, 4)
    for sub, (title, value) in enumerate(identity._asdict().items(), start=1):
        yield ObjectEntry((0x1018, sub), "identity", title, UINT32, value)
    yield ObjectEntry((0x1C00, 0), "sync manager types", "number of entries", UINT8, 4)
    for sub in range(1, 5):
        yield ObjectEntry((0x1C00, sub), "sync manager types", f"SM{sub - 1}", UINT8, sub)
    supported = ONLY_SYNC0 if needs_sync0 else SUPPORTED
    for index, title, kind in (
        (0x1C32, "output synchronisation", WITH_SYNC0 if needs_sync0 else WITH_OUTPUTS),
        (0x1C33, "input synchronisation", WITH_SYNC0 if needs_sync0 else INPUTS_WITH_OUTPUTS),
    ):
        yield ObjectEntry((index, 0), title, "number of entries", UINT8, 0x20)
        yield ObjectEntry((index, 1), title, "type", UINT16, kind, True, False, 0, 0x22)
        yield ObjectEntry((index, 2), title, "cycle, ns", UINT32, cycle_ns, True)
        yield ObjectEntry((index, 4), title, "supported types", UINT16, supported)
        yield ObjectEntry((index, 5), title, "shortest cycle, ns", UINT32, 250_000)
        yield ObjectEntry((index, 6), title, "calculation and copy, ns", UINT32, 50_000)
        yield ObjectEntry((index, 0x0B), title, "missed events", UINT16)
        yield ObjectEntry((index, 0x0C), title, "exceeded cycles", UINT16)
        yield ObjectEntry((index, 0x20), title, "synchronisation error", BOOLEAN)
    title = "error settings"
    yield ObjectEntry((0x10F1, 0), title, "number of entries", UINT8, 2)
    yield ObjectEntry((0x10F1, 1), title, "local reaction", UINT32, 0, True)
    yield ObjectEntry((0x10F1, 2), title, "limit of synchronisation errors", UINT16, 4, True)


def drive_objects(
    entries: Iterable[ObjectEntry],
    identity: Identity,
    name: str,
    mappings: Mappings,
    *,
    needs_sync0: bool = False,
) -> Iterator[ObjectEntry]:
    """Yield the objects of a CANopen drive as those of a CoE slave.

    What belongs to CAN (identifiers, heartbeats, SYNC, its PDOs) is left out.
    """
    for entry in entries:
        if entry.key[0] in KEPT or entry.key[0] >= FIRST_OF_DEVICE:
            yield entry
    yield from slave_objects(identity, name, needs_sync0=needs_sync0)
    yield from mapping_objects({**mappings.rx, **mappings.tx}, slots=mappings.slots)
    for index, assigned, known in (
        (RX_ASSIGNMENT, mappings.rx_assigned, mappings.rx),
        (TX_ASSIGNMENT, mappings.tx_assigned, mappings.tx),
    ):
        yield from assignment_objects(index, assigned, slots=len(known))
