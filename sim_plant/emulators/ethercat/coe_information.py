"""SDO information of CoE: the list of objects, and descriptions of objects and entries."""

from __future__ import annotations

import struct
from collections.abc import Callable

from sim_plant.emulators.device_objects import VISIBLE_STRING, Key, Objects, ObjectType

_HEADER = struct.Struct("<BBH")  # operation, reserved, fragments left
INCOMPLETE = 0x80
LIST, LIST_ANSWER, OBJECT, OBJECT_ANSWER = 1, 2, 3, 4
ENTRY, ENTRY_ANSWER, ERROR = 5, 6, 7
COUNTS, ALL, RX_MAPPABLE, TX_MAPPABLE, STORED, START = range(6)  # lists
VAR, ARRAY, RECORD = 7, 8, 9  # kinds of objects
READ_ALWAYS, WRITE_ALWAYS, MAPS_RX, MAPS_TX = 0x07, 0x38, 0x40, 0x80  # access
NO_OBJECT, NO_SUBINDEX, UNKNOWN_COMMAND = 0x06020000, 0x06090011, 0x05040001


def serve(objects: Objects, request: bytes, room: int) -> list[bytes]:
    """Return the answers to a request; each, with its header, has at most `room` octets."""
    if len(request) < _HEADER.size + 2:
        return [_error(UNKNOWN_COMMAND)]
    operation = request[0] & ~INCOMPLETE
    (index,) = struct.unpack_from("<H", request, _HEADER.size)
    if operation == LIST:
        return _fragments(_list(objects, index), room)
    if operation not in (OBJECT, ENTRY):
        return [_error(UNKNOWN_COMMAND)]
    keys = sorted(key for key in objects.entries if key[0] == index)
    if not keys:
        return [_error(NO_OBJECT)]
    if operation == OBJECT:
        return [_answer(OBJECT_ANSWER, _object(objects, keys))]
    subindex = request[6] if len(request) > 6 else 0
    if (index, subindex) not in objects.entries:
        return [_error(NO_SUBINDEX)]
    return [_answer(ENTRY_ANSWER, _entry(objects, (index, subindex)))]


def _answer(operation: int, data: bytes, left: int = 0) -> bytes:
    return _HEADER.pack(operation | (INCOMPLETE if left else 0), 0, left) + data


def _error(code: int) -> bytes:
    return _answer(ERROR, code.to_bytes(4, "little"))


def _fragments(data: bytes, room: int) -> list[bytes]:
    size = (room - _HEADER.size) & ~1
    parts = [data[at : at + size] for at in range(0, len(data), size)]
    last = len(parts) - 1
    return [_answer(LIST_ANSWER, part, last - n) for n, part in enumerate(parts)]


def _is_rx(type_: ObjectType) -> bool:
    return type_.mappable and type_.writable


def _is_tx(type_: ObjectType) -> bool:
    return type_.mappable


_LISTS: dict[int, Callable[[ObjectType], bool]] = {RX_MAPPABLE: _is_rx, TX_MAPPABLE: _is_tx}


def _indices(objects: Objects, kind: int) -> list[int]:
    if kind == ALL:
        return sorted({index for index, _ in objects.entries})
    accepts = _LISTS.get(kind)
    if accepts is None:
        return []
    return sorted({key[0] for key, type_ in objects.types.items() if accepts(type_)})


def _list(objects: Objects, kind: int) -> bytes:
    if kind == COUNTS:
        numbers = [len(_indices(objects, each)) for each in range(ALL, START + 1)]
    else:
        numbers = _indices(objects, kind)
    return struct.pack(f"<H{len(numbers)}H", kind, *numbers)


def _object(objects: Objects, keys: list[Key]) -> bytes:
    index = keys[0][0]
    entry = objects.entries[keys[0]]
    kind = VAR if len(keys) == 1 else RECORD
    name = entry.object_name.encode("ascii", "replace")
    return struct.pack("<HHBB", index, entry.data_type, keys[-1][1], kind) + name


def _entry(objects: Objects, key: Key) -> bytes:
    entry, type_ = objects.entries[key], objects.types.get(key)
    text = str(entry.default) if entry.data_type == VISIBLE_STRING else ""
    access = READ_ALWAYS | (WRITE_ALWAYS if entry.writable else 0)
    if type_ is not None:
        access |= (MAPS_RX if _is_rx(type_) else 0) | (MAPS_TX if _is_tx(type_) else 0)
    bits = type_.bits if type_ is not None else 8 * len(text)
    data = struct.pack("<HBBHHH", *key, 0, entry.data_type, bits, access)
    return data + entry.name.encode("ascii", "replace")
