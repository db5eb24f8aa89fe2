"""CANopen over EtherCAT: the SDO server of a slave over its objects (ETG.1000.6).

Expedited, normal and segmented transfers, complete access, aborts, emergencies.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import NamedTuple

from sim_plant.emulators.device_objects import (
    READ_ONLY,
    VISIBLE_STRING,
    Key,
    Objects,
    SdoRefusedError,
)
from sim_plant.emulators.ethercat import coe_information

EMERGENCY, SDO_REQUEST, SDO_RESPONSE, SDO_INFORMATION = 1, 2, 3, 8  # services
_SDO = struct.Struct("<BHB")
_U32 = struct.Struct("<I")
HEADER = 2
COMPLETE, EXPEDITED, SIZED, TOGGLE = 0x10, 0x02, 0x01, 0x10
SHORTEST_SEGMENT = 7

# SDO abort codes
TOGGLE_UNCHANGED = 0x05030000
UNKNOWN_COMMAND = 0x05040001
OUT_OF_MEMORY = 0x05040005
NO_ACCESS = 0x06010000
NO_OBJECT = 0x06020000
WRONG_LENGTH = 0x06070010
TOO_LONG = 0x06070012
TOO_SHORT = 0x06070013
NO_SUBINDEX = 0x06090011
NOT_IN_THIS_STATE = 0x08000022
MAX_TRANSFER = 0x10000  # octets of one object


class _Transfer(NamedTuple):
    """A segmented transfer under way."""

    key: Key
    complete: bool
    download: bool
    data: bytearray
    size: int
    toggle: int


def box(service: int, data: bytes) -> bytes:
    """Return the data of a CoE box."""
    return (service << 12).to_bytes(2, "little") + data


def emergency(data: bytes) -> bytes:
    """Return an emergency of 8 octets: code, register, 5 of the maker."""
    return box(EMERGENCY, data)


class SdoServer:
    """The SDO server of one slave."""

    def __init__(self, objects: Objects, capacity: Callable[[], int]) -> None:
        """`capacity`: octets of CoE data, with their header, that a box for the master holds."""
        self._objects = objects
        self._capacity = capacity
        self._transfer: _Transfer | None = None

    def reset(self) -> None:
        """Give up a transfer under way."""
        self._transfer = None

    def serve(self, data: bytes) -> list[bytes]:
        """Return the boxes that answer one; without an answer none."""
        service = int.from_bytes(data[:2], "little") >> 12
        body = data[HEADER:]
        if service == SDO_INFORMATION:
            room = self._capacity() - HEADER
            parts = coe_information.serve(self._objects, body, room)
            return [box(SDO_INFORMATION, part) for part in parts]
        if service != SDO_REQUEST or not body:
            return []
        index, subindex = 0, 0
        try:
            if len(body) >= _SDO.size:
                _, index, subindex = _SDO.unpack_from(body)
            answer = self._sdo(body)
        except SdoRefusedError as error:
            transfer, self._transfer = self._transfer, None
            if transfer is not None and body[0] >> 5 in (0, 3):
                index, subindex = transfer.key
            abort = _SDO.pack(0x80, index, subindex) + _U32.pack(error.code)
            return [box(SDO_REQUEST, abort)]
        return [box(SDO_RESPONSE, answer)] if answer else []

    def _sdo(self, body: bytes) -> bytes:
        command = body[0]
        kind = command >> 5
        if kind == 4:  # abort by the master
            self._transfer = None
            return b""
        if kind in (0, 3):
            return self._segment(body)
        if kind not in (1, 2) or len(body) < 8:
            raise SdoRefusedError(UNKNOWN_COMMAND)
        _, index, subindex = _SDO.unpack_from(body)
        self._transfer = None
        complete = bool(command & COMPLETE)
        if complete and subindex > 1:
            raise SdoRefusedError(NO_ACCESS)
        if kind == 1:
            return self._download(command, index, subindex, body[4:])
        return self._upload(index, subindex, complete)

    # ---- download: master to slave ---------------------------------------------------------------

    def _download(self, command: int, index: int, subindex: int, data: bytes) -> bytes:
        complete = bool(command & COMPLETE)
        if command & EXPEDITED:
            octets = 4 - (command >> 2 & 3) if command & SIZED else 4
            self._store(index, subindex, complete, data[:octets])
        else:
            (size,) = _U32.unpack_from(data)
            part = data[4 : 4 + size]
            if size > MAX_TRANSFER:
                raise SdoRefusedError(OUT_OF_MEMORY)
            if len(part) < size:
                self._transfer = _Transfer(
                    (index, subindex), complete, True, bytearray(part), size, 0
                )
            else:
                self._store(index, subindex, complete, part)
        return _SDO.pack(0x60 | command & COMPLETE, index, subindex) + bytes(4)

    def _segment(self, body: bytes) -> bytes:
        transfer, command = self._transfer, body[0]
        if transfer is None or transfer.download != (command >> 5 == 0):
            raise SdoRefusedError(UNKNOWN_COMMAND)
        if command & TOGGLE != transfer.toggle:
            raise SdoRefusedError(TOGGLE_UNCHANGED)
        self._transfer = transfer._replace(toggle=transfer.toggle ^ TOGGLE)
        if not transfer.download:
            return self._upload_segment(transfer)
        part = body[1:]
        if len(part) == SHORTEST_SEGMENT:
            part = part[: SHORTEST_SEGMENT - (command >> 1 & 7)]
        transfer.data.extend(part)
        if len(transfer.data) > transfer.size:
            raise SdoRefusedError(TOO_LONG)
        if command & 1:  # the last one
            if len(transfer.data) < transfer.size:
                raise SdoRefusedError(TOO_SHORT)
            self._transfer = None
            self._store(*transfer.key, transfer.complete, bytes(transfer.data))
        return bytes([0x20 | transfer.toggle]) + bytes(SHORTEST_SEGMENT)

    def _store(self, index: int, subindex: int, complete: bool, data: bytes) -> None:
        objects = self._objects
        if not complete:
            self._store_one((index, subindex), data)
            return
        self._require(index, 0)
        at, parts = 0, []
        for key in _subindices(objects, index, subindex):
            octets = 2 if key[1] == 0 else _octets(objects, key)
            if at >= len(data):
                break
            parts.append((key, data[at : at + 1] if key[1] == 0 else data[at : at + octets]))
            at += octets
        if at < len(data):
            raise SdoRefusedError(TOO_LONG)
        if len(parts) > 1 and parts[0][0] == (index, 0) and objects.types[index, 0].writable:
            count = parts.pop(0)  # as one by one: none, the entries, their number
            parts = [(count[0], b"\0"), *parts, count]
        for key, part in parts:
            self._store_one(key, part)

    def _store_one(self, key: Key, data: bytes) -> None:
        self._require(*key)
        type_ = self._objects.types.get(key)
        if type_ is None:
            raise SdoRefusedError(READ_ONLY)
        octets = _octets(self._objects, key)
        if len(data) != octets:
            raise SdoRefusedError(TOO_LONG if len(data) > octets else TOO_SHORT)
        value = int.from_bytes(data, "little", signed=type_.signed)
        self._objects.check(key, value)
        self._objects.write(key, value)

    # ---- upload: slave to master -----------------------------------------------------------------

    def _upload(self, index: int, subindex: int, complete: bool) -> bytes:
        objects = self._objects
        self._require(index, 0 if complete else subindex)
        if complete:
            used = objects.get(index)
            keys = [k for k in _subindices(objects, index, subindex) if not k[1] or k[1] <= used]
            parts = [_value(objects, key) for key in keys]
            data = b"".join(
                part.ljust(2, b"\0") if key[1] == 0 else part
                for key, part in zip(keys, parts, strict=True)
            )
        else:
            data = _value(objects, (index, subindex))
        flag = COMPLETE if complete else 0
        if 0 < len(data) <= 4:
            command = 0x40 | flag | (4 - len(data)) << 2 | EXPEDITED | SIZED
            return _SDO.pack(command, index, subindex) + data.ljust(4, b"\0")
        room = self._capacity() - HEADER - 8
        head = _SDO.pack(0x40 | flag | SIZED, index, subindex) + _U32.pack(len(data))
        if len(data) > room:
            rest = bytearray(data[room:])
            self._transfer = _Transfer((index, subindex), complete, False, rest, len(rest), 0)
        return head + data[:room]

    def _upload_segment(self, transfer: _Transfer) -> bytes:
        room = self._capacity() - HEADER - 1
        part = bytes(transfer.data[:room])
        del transfer.data[:room]
        last = not transfer.data
        if last:
            self._transfer = None
        unused = max(0, SHORTEST_SEGMENT - len(part))
        command = transfer.toggle | unused << 1 | last
        return bytes([command]) + part.ljust(SHORTEST_SEGMENT, b"\0")

    def _require(self, index: int, subindex: int) -> None:
        if (index, subindex) in self._objects.entries:
            return
        known = any(key[0] == index for key in self._objects.entries)
        raise SdoRefusedError(NO_SUBINDEX if known else NO_OBJECT)


def _subindices(objects: Objects, index: int, first: int) -> list[Key]:
    return sorted(key for key in objects.entries if key[0] == index and key[1] >= first)


def _octets(objects: Objects, key: Key) -> int:
    return (objects.types[key].bits + 7) // 8


def _value(objects: Objects, key: Key) -> bytes:
    type_ = objects.types.get(key)
    if type_ is not None:
        return objects.values[key].to_bytes((type_.bits + 7) // 8, "little", signed=type_.signed)
    entry = objects.entries[key]
    if entry.data_type != VISIBLE_STRING:
        raise SdoRefusedError(NO_ACCESS)
    return str(entry.default).encode("ascii") or b"\0"
