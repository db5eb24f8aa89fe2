"""Process data objects (PDO): their mapped entries, packed with one compiled layout.

COB-IDs by the predefined connection set of CiA 301; little-endian, no padding, 8 bytes at most.
"""

import struct
from typing import NamedTuple

from drivers.canopen.codec_error import CodecError, wrong_length
from drivers.cia402.process_data import (
    BYTES,
    CONTROLWORD,
    ERROR_CODE,
    MODE,
    MODE_DISPLAY,
    POSITION,
    PROFILE_VELOCITY,
    STATUSWORD,
    TARGET_POSITION,
    TARGET_TORQUE,
    TORQUE,
    TYPES,
    Entry,
)

MAX_BYTES = 8
MAX_NODE = 127


class Layout(NamedTuple):
    """A PDO of one node, ready to pack and unpack."""

    cob_id: int
    entries: tuple[Entry, ...]
    packing: struct.Struct


class PdoError(ValueError):
    """An invalid PDO; names it and the problem."""


# A torque axis: 4 bytes out and 8 bytes back on every SYNC, the rest on a divider of it.
AXIS_COMMAND = (CONTROLWORD, TARGET_TORQUE)
AXIS_STATUS = (STATUSWORD, TORQUE, POSITION)
AXIS_SLOW_STATUS = (MODE_DISPLAY, ERROR_CODE)

# A positioning actuator: 11 bytes out in total, so two frames; the target is sent first, because
# the controlword makes the drive accept it.
ACTUATOR_TARGET = (TARGET_POSITION, PROFILE_VELOCITY)
ACTUATOR_COMMAND = (CONTROLWORD, MODE)
ACTUATOR_STATUS = (STATUSWORD, MODE_DISPLAY, POSITION)


def rpdo_cob_id(number: int, node: int) -> int:
    """Return the COB-ID of a frame to the node: 0x200, 0x300, 0x400, 0x500 + node, RPDO 1 to 4."""
    return _predefined("RPDO", 0x100, number, node)


def tpdo_cob_id(number: int, node: int) -> int:
    """Return the COB-ID of a frame from the node: 0x180, 0x280, 0x380, 0x480 + node (1 to 4)."""
    return _predefined("TPDO", 0x080, number, node)


def _predefined(kind: str, base: int, number: int, node: int) -> int:
    if not 1 <= node <= MAX_NODE:
        raise PdoError(f"node {node}: CANopen nodes are 1 to {MAX_NODE}")
    if not 1 <= number <= 4:
        raise PdoError(f"{kind}{number}: only 1 to 4 have a predefined COB-ID")
    return base + 0x100 * number + node


def size(entries: tuple[Entry, ...]) -> int:
    """Return the bytes of a PDO; PdoError for no entries, too many, or an unknown type."""
    for entry in entries:
        if entry.type not in TYPES:
            raise PdoError(f"{entry.object:#06x}:{entry.sub} {entry.name}: no type {entry.type!r}")
    total = sum(BYTES[entry.type] for entry in entries)
    if not 0 < total <= MAX_BYTES:
        names = ", ".join(entry.name for entry in entries)
        raise PdoError(f"PDO of {names or 'nothing'}: {total} bytes, 1 to {MAX_BYTES} fit a frame")
    return total


def layout(cob_id: int, entries: tuple[Entry, ...]) -> Layout:
    """Return the compiled layout of a PDO; PdoError for an invalid one."""
    size(entries)
    if not 0x181 <= cob_id <= 0x57F:
        raise PdoError(f"COB-ID {cob_id:#05x} is not one of a PDO, 0x181 to 0x57f")
    return Layout(
        cob_id, entries, struct.Struct("<" + "".join(TYPES[entry.type] for entry in entries))
    )


def pack(pdo: Layout, *values: int) -> bytes:
    """Return the frame's bytes; CodecError names the value outside its type's range."""
    try:
        return pdo.packing.pack(*values)
    except struct.error:
        pass
    if len(values) != len(pdo.entries):
        raise CodecError(pdo.cob_id, f"{len(pdo.entries)} values", f"{len(values)}")
    wrong = [
        (entry, value)
        for entry, value in zip(pdo.entries, values, strict=True)
        if not _fits(entry.type, value)
    ]
    entry, value = wrong[0]
    raise CodecError(pdo.cob_id, f"{entry.type} for {entry.name}", repr(value))


def _fits(kind: str, value: int) -> bool:
    try:
        struct.pack("<" + TYPES[kind], value)
    except struct.error:
        return False
    return True


def unpack(pdo: Layout, data: bytes) -> tuple[int, ...]:
    """Return the values in the order of the entries; CodecError for a wrong length."""
    try:
        return pdo.packing.unpack(data)
    except struct.error:
        raise wrong_length(pdo.cob_id, pdo.packing.size, len(data)) from None
