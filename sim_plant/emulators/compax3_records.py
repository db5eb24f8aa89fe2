"""The bytes of a Parker Compax3's serial port: binary records and ASCII lines on one line.

Source: Parker manuals 192-1201xx, "Control via RS232 / RS485 / USB": layout of records, check
sum, 5 ms between two codes, DSP formats INT24 and REAL48, ASCII record.
"""

from __future__ import annotations

import math
import struct
from typing import Literal, NamedTuple

from sim_plant.units import Count, Second

Format = Literal["REAL48", "INT24"]

RESPONSE, ACKNOWLEDGED, REFUSED = 0x05, 0x06, 0x07
READ, WRITE = 0xA4, 0xC4  # with bits 0 (address follows), 1 (gateway), 3 (PLC formats) cleared
KIND, ADDRESSED, PLC = 0xF4, 0x01, 0x08
LONGEST_LINE = 200


def _table() -> tuple[int, ...]:
    entries = []
    for value in range(256):
        crc = value << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
        entries.append(crc)
    return tuple(entries)


TABLE = _table()


def crc(data: bytes) -> int:
    """Give the check sum: CCITT table, start 0, each byte put in at the low end (not XMODEM's)."""
    value = 0
    for byte in data:
        value = TABLE[value >> 8] ^ (value << 8 & 0xFFFF) ^ byte
    return value


def record(start: int, data: bytes) -> bytes:
    """Give a record from drive to host; 1 to 256 data bytes."""
    body = bytes((start, len(data) - 1)) + data
    return body + crc(body).to_bytes(2, "big")


def refused(code: int) -> bytes:
    """Give the negative answer with its 16-bit code."""
    return record(REFUSED, code.to_bytes(2, "big"))


def encode(form: Format, value: float, *, plc: bool) -> bytes:
    """Give a value as data bytes: DSP formats, or with `plc` IEEE float32 and 16 bits.

    That INT24 objects have 16 bits in PLC format is not confirmed.
    """
    if form == "INT24":
        size = 2 if plc else 3
        return (round(value) & (1 << 8 * size) - 1).to_bytes(size, "big")
    if plc:
        return struct.pack(">f", value)
    scaled = round(value * 0x1000000)
    held = max(-(1 << 47), min(scaled, (1 << 47) - 1))
    return held.to_bytes(6, "big", signed=True)


def decode(form: Format, data: bytes, *, plc: bool) -> float | None:
    """Give the value of data bytes; None for a wrong length or what is no number."""
    if form == "INT24":
        return float(int.from_bytes(data, "big")) if len(data) == (2 if plc else 3) else None
    if plc:
        value = struct.unpack(">f", data)[0] if len(data) == 4 else math.nan
        return value if math.isfinite(value) else None
    return int.from_bytes(data, "big", signed=True) / 0x1000000 if len(data) == 6 else None


class Record(NamedTuple):
    """A record from the host; `whole` tells whether its check sum is right."""

    start: int
    address: int | None
    data: bytes
    whole: bool


class Receiver:
    """Tells records from lines by their first byte, as the drive does."""

    def __init__(self, gap: Second = 0.005) -> None:
        """`gap`: silence within a record after which it is given up (5 ms, manual)."""
        self.gap = gap
        self.given_up: Count = 0
        self.stray: Count = 0  # bytes that begin nothing
        self._buffer = b""
        self._last: Second = float("-inf")

    def feed(self, data: bytes, now: Second) -> list[Record | str]:
        """Give the records and lines that are complete now; lines without their CR."""
        if self._buffer and self._binary() and now - self._last > self.gap:
            self.given_up += 1
            self._buffer = b""
        self._last = now
        found: list[Record | str] = []
        for byte in data:
            self._buffer += bytes((byte,))
            if self._binary():
                if len(self._buffer) == self._size():
                    found.append(self._record())
                    self._buffer = b""
            elif byte == 0x0D:
                found.append(self._buffer[:-1].decode("ascii"))
                self._buffer = b""
            elif not 0x20 <= byte <= 0x7E or len(self._buffer) > LONGEST_LINE:
                self.stray += len(self._buffer)
                self._buffer = b""
        return found

    def _binary(self) -> bool:
        return self._buffer[0] & KIND in (READ, WRITE)

    def _head(self) -> Count:
        return 3 if self._buffer[0] & ADDRESSED else 2

    def _size(self) -> Count:
        head = self._head()
        return head + self._buffer[head - 1] + 3 if len(self._buffer) >= head else 0

    def _record(self) -> Record:
        head = self._head()
        whole = crc(self._buffer[:-2]) == int.from_bytes(self._buffer[-2:], "big")
        address = self._buffer[1] if head == 3 else None
        return Record(self._buffer[0], address, self._buffer[head:-2], whole)
