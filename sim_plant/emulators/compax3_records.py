"""Protocol of a Parker Compax3's serial port: binary records and ASCII lines.

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
MAX_LINE_LENGTH = 200


def _crc_table() -> tuple[int, ...]:
    entries = []
    for value in range(256):
        crc = value << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
        entries.append(crc)
    return tuple(entries)


CRC_TABLE = _crc_table()


def crc(data: bytes) -> int:
    """Return the check sum: CCITT table, start 0, bytes enter at the low end (not XMODEM's)."""
    value = 0
    for byte in data:
        value = CRC_TABLE[value >> 8] ^ (value << 8 & 0xFFFF) ^ byte
    return value


def encode_record(start: int, data: bytes) -> bytes:
    """Return a record from drive to host; 1 to 256 data bytes."""
    body = bytes((start, len(data) - 1)) + data
    return body + crc(body).to_bytes(2, "big")


def encode_refusal(code: int) -> bytes:
    """Return the negative answer with its 16-bit code."""
    return encode_record(REFUSED, code.to_bytes(2, "big"))


def encode_value(form: Format, value: float, *, plc: bool) -> bytes:
    """Return a value as data bytes: DSP formats, or with `plc` IEEE float32 and 16 bits.

    The 16-bit PLC format of INT24 objects is not confirmed.
    """
    if form == "INT24":
        size = 2 if plc else 3
        return (round(value) & (1 << 8 * size) - 1).to_bytes(size, "big")
    if plc:
        return struct.pack(">f", value)
    scaled = round(value * 0x1000000)
    clamped = max(-(1 << 47), min(scaled, (1 << 47) - 1))
    return clamped.to_bytes(6, "big", signed=True)


def decode_value(form: Format, data: bytes, *, plc: bool) -> float | None:
    """Return the value of data bytes; None for a wrong length or a value that is not finite."""
    if form == "INT24":
        return float(int.from_bytes(data, "big")) if len(data) == (2 if plc else 3) else None
    if plc:
        value = struct.unpack(">f", data)[0] if len(data) == 4 else math.nan
        return value if math.isfinite(value) else None
    return int.from_bytes(data, "big", signed=True) / 0x1000000 if len(data) == 6 else None


class Record(NamedTuple):
    """A record from the host; `crc_ok` is True if its check sum is right."""

    start: int
    address: int | None
    data: bytes
    crc_ok: bool


class RecordReceiver:
    """Separates records from lines by their first byte, as the drive does."""

    def __init__(self, gap: Second = 0.005) -> None:
        """`gap`: silence within a record after which it is discarded (5 ms, manual)."""
        self.gap = gap
        self.abandoned: Count = 0
        self.stray_bytes: Count = 0  # bytes outside records and lines
        self._buffer = b""
        self._last_time: Second = float("-inf")

    def feed(self, data: bytes, now: Second) -> list[Record | str]:
        """Return the records and lines that are complete now; lines without their CR."""
        if self._buffer and self._is_record() and now - self._last_time > self.gap:
            self.abandoned += 1
            self._buffer = b""
        self._last_time = now
        messages: list[Record | str] = []
        for byte in data:
            self._buffer += bytes((byte,))
            if self._is_record():
                if len(self._buffer) == self._record_size():
                    messages.append(self._record())
                    self._buffer = b""
            elif byte == 0x0D:
                messages.append(self._buffer[:-1].decode("ascii"))
                self._buffer = b""
            elif not 0x20 <= byte <= 0x7E or len(self._buffer) > MAX_LINE_LENGTH:
                self.stray_bytes += len(self._buffer)
                self._buffer = b""
        return messages

    def _is_record(self) -> bool:
        return self._buffer[0] & KIND in (READ, WRITE)

    def _header_size(self) -> Count:
        return 3 if self._buffer[0] & ADDRESSED else 2

    def _record_size(self) -> Count:
        head = self._header_size()
        return head + self._buffer[head - 1] + 3 if len(self._buffer) >= head else 0

    def _record(self) -> Record:
        head = self._header_size()
        crc_ok = crc(self._buffer[:-2]) == int.from_bytes(self._buffer[-2:], "big")
        address = self._buffer[1] if head == 3 else None
        return Record(self._buffer[0], address, self._buffer[head:-2], crc_ok)
