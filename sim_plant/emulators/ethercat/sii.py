"""The SII image of a slave (its EEPROM): identity, mailbox, categories, check octet.

Addresses are those of 16-bit words.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple

from sim_plant.emulators.device_objects import Key

ALIAS, CHECK, VENDOR, MAILBOX_IN = 0x04, 0x07, 0x08, 0x18
SIZE, CATEGORIES = 0x3E, 0x40
STRINGS, GENERAL, FMMU, SYNC_MANAGER = 10, 30, 40, 41
TX_PDO, RX_PDO, END = 50, 51, 0xFFFF
COE_PROTOCOL = 0x0004
ENABLE_SDO, SDO_INFORMATION, PDO_ASSIGNMENT, PDO_CONFIGURATION = 0x01, 0x02, 0x04, 0x08
UPLOAD_AT_START, COMPLETE_ACCESS = 0x10, 0x20
FORBIDS_LRW = 0x02  # flag of the general category
FMMU_OUTPUTS, FMMU_INPUTS, FMMU_MAILBOX = 1, 2, 3
MAILBOX_OUT_TYPE, MAILBOX_IN_TYPE, OUTPUTS_TYPE, INPUTS_TYPE = 1, 2, 3, 4  # of sync managers


class Identity(NamedTuple):
    """Identity of a slave."""

    vendor: int
    product: int
    revision: int = 1
    serial: int = 0


class SyncManagerSetting(NamedTuple):
    """Default of one sync manager."""

    start: int
    length: int
    control: int
    type: int


class PdoEntry(NamedTuple):
    """One entry of a PDO; the object 0, 0 is a gap."""

    key: Key
    bits: int
    data_type: int = 0
    name: str = ""


class Pdo(NamedTuple):
    """One PDO with its sync manager."""

    number: int  # 0x1600.., 0x1A00..
    sync_manager: int
    entries: tuple[PdoEntry, ...]
    name: str = ""


class Information(NamedTuple):
    """All that an image contains."""

    identity: Identity
    name: str
    sync_managers: tuple[SyncManagerSetting, ...] = ()
    fmmus: tuple[int, ...] = ()
    tx_pdos: tuple[Pdo, ...] = ()
    rx_pdos: tuple[Pdo, ...] = ()
    coe_details: int = 0  # 0: no mailbox
    flags: int = 0
    ebus_current: int = 0  # mA
    alias: int = 0


def check_octet(octets: Sequence[int]) -> int:
    """Return the check octet of the first 14 octets: CRC-8, polynomial 0x07, start 0xFF."""
    crc = 0xFF
    for octet in octets[:14]:
        crc ^= octet
        for _ in range(8):
            crc = (crc << 1 ^ 0x07) & 0xFF if crc & 0x80 else crc << 1
    return crc


def image(information: Information, size: int = 0x800) -> bytes:
    """Return the image, filled up with FF to a size in octets. Raises ValueError if too small."""
    head = bytearray(2 * CATEGORIES)
    struct.pack_into("<H", head, 2 * ALIAS, information.alias)
    struct.pack_into("<H", head, 2 * CHECK, check_octet(head))
    struct.pack_into("<4I", head, 2 * VENDOR, *information.identity)
    if information.coe_details:
        boxes = [
            each
            for kind in (MAILBOX_OUT_TYPE, MAILBOX_IN_TYPE)
            for each in information.sync_managers
            if each.type == kind
        ]
        fields = [value for box in boxes for value in (box.start, box.length)]
        struct.pack_into("<5H", head, 2 * MAILBOX_IN, *fields, COE_PROTOCOL)
    struct.pack_into("<HH", head, 2 * SIZE, size // 128 - 1, 1)
    texts = _Texts()
    body = b"".join(_categories(information, texts))
    strings = _category(STRINGS, texts.data())
    full = bytes(head) + strings + body + END.to_bytes(2, "little")
    if len(full) > size:
        raise ValueError(f"an SII image of {len(full)} octets exceeds {size}")
    return full.ljust(size, b"\xff")


class _Texts:
    """The strings of an image, numbered from 1; 0 is the empty one."""

    def __init__(self) -> None:
        self._listed: list[str] = []

    def number(self, text: str) -> int:
        if not text:
            return 0
        if text not in self._listed:
            self._listed.append(text)
        return self._listed.index(text) + 1

    def data(self) -> bytes:
        encoded = [text.encode("ascii") for text in self._listed]
        return bytes([len(encoded)]) + b"".join(bytes([len(each)]) + each for each in encoded)


def _categories(information: Information, texts: _Texts) -> list[bytes]:
    name = texts.number(information.name)
    general = bytearray(32)
    general[3], general[5], general[0xB] = name, information.coe_details, information.flags
    struct.pack_into("<h", general, 0xC, information.ebus_current)
    parts = [_category(GENERAL, bytes(general))]
    if information.fmmus:
        parts.append(_category(FMMU, bytes(information.fmmus)))
    managers = [
        struct.pack("<HHBBBB", each.start, each.length, each.control, 0, 1, each.type)
        for each in information.sync_managers
    ]
    if managers:
        parts.append(_category(SYNC_MANAGER, b"".join(managers)))
    for kind, pdos in ((TX_PDO, information.tx_pdos), (RX_PDO, information.rx_pdos)):
        if pdos:
            parts.append(_category(kind, _pdos(pdos, texts)))
    return parts


def _pdos(pdos: Sequence[Pdo], texts: _Texts) -> bytes:
    parts = []
    for number, manager, entries, name in pdos:
        parts.append(
            struct.pack("<HBBBBH", number, len(entries), manager, 0, texts.number(name), 0)
        )
        parts += [
            struct.pack(
                "<HBBBBH", *each.key, texts.number(each.name), each.data_type,
                each.bits, 0,
            )
            for each in entries
        ]  # fmt: skip
    return b"".join(parts)


def _category(kind: int, data: bytes) -> bytes:
    padded = data + b"\0" * (len(data) % 2)
    return struct.pack("<HH", kind, len(padded) // 2) + padded
