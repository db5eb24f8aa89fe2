"""Modbus RTU: several units on one serial line.

Modbus over serial line V1.02: address, PDU, CRC-16 (low byte first), silence between frames.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import NamedTuple

from sim_plant.emulators.line_device import LineDevice
from sim_plant.emulators.modbus_unit import ModbusUnit
from sim_plant.emulators.serial_line import SerialLine
from sim_plant.units import Count, Second

POLL_PERIOD = 0.01  # s between two updates of the units' timers
MAX_FRAME_LENGTH = 256  # bytes of one frame
FRAME_LENGTHS: Mapping[int, Count] = {**dict.fromkeys(range(1, 7), 8), 22: 10}
BYTE_COUNT_OFFSETS: Mapping[int, Count] = {
    15: 6,
    16: 6,
    23: 10,
}  # offset of the byte count in these functions


def crc16(data: bytes) -> int:
    """Return the check sum of an RTU frame: polynomial 8005 reflected, start FFFF."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc


def encode_frame(address: int, pdu: bytes) -> bytes:
    """Return the frame of an answer."""
    body = bytes((address,)) + pdu
    return body + crc16(body).to_bytes(2, "little")


class RtuSettings(NamedTuple):
    """Framing of a line's units."""

    # Real units end a frame after 3.5 characters of silence. A host's adapter and a busy machine
    # leave longer gaps within frames, so the silence that ends a frame is longer here.
    silence: Second = 0.02
    lengths: Mapping[int, Count] = FRAME_LENGTHS  # bytes of a complete frame, by function


class RtuReceiver:
    """Extracts requests from received bytes; skips to the next silence after a wrong check sum."""

    def __init__(self, settings: RtuSettings) -> None:
        """Create a receiver with an empty buffer."""
        self.settings = settings
        self.bad_frames: Count = 0  # frames with a wrong check sum
        self.truncated_frames: Count = 0  # frames that ended early
        self._buffer = b""
        self._skipping = False
        self._last_time: Second = float("-inf")

    def feed(self, data: bytes, now: Second) -> list[tuple[int, bytes]]:
        """Return the requests that are complete now: address and PDU."""
        if now - self._last_time > self.settings.silence:
            self.truncated_frames += 1 if self._buffer else 0
            self._buffer, self._skipping = b"", False
        self._last_time = now
        if self._skipping:
            return []
        self._buffer += data
        frames = []
        while not self._skipping and (size := self._frame_size()) and len(self._buffer) >= size:
            frame, self._buffer = self._buffer[:size], self._buffer[size:]
            if crc16(frame[:-2]) == int.from_bytes(frame[-2:], "little"):
                frames.append((frame[0], frame[1:-2]))
            else:
                self.bad_frames += 1
                self._buffer, self._skipping = b"", True
        return frames

    def _frame_size(self) -> Count:
        """Return the size of the frame at the start of the buffer; 0 while it is unknown."""
        if len(self._buffer) < 2:
            return 0
        function = self._buffer[1]
        if function in BYTE_COUNT_OFFSETS:
            offset = BYTE_COUNT_OFFSETS[function]
            return offset + self._buffer[offset] + 3 if len(self._buffer) > offset else 0
        if function in self.settings.lengths:
            return self.settings.lengths[function]
        return self._size_by_check_sum()

    def _size_by_check_sum(self) -> Count:
        """Return the size at which the check sum fits: an unknown function can then be refused."""
        for size in range(4, min(len(self._buffer), MAX_FRAME_LENGTH) + 1):
            candidate = self._buffer[:size]
            if crc16(candidate[:-2]) == int.from_bytes(candidate[-2:], "little"):
                return size
        return len(self._buffer) if len(self._buffer) >= MAX_FRAME_LENGTH else 0


class RtuLine(LineDevice):
    """Units on one serial line. Requests to other addresses are not answered."""

    def __init__(
        self,
        line: SerialLine,
        units: Mapping[int, ModbusUnit],
        settings: RtuSettings | None = None,
    ) -> None:
        """`units` by address, 1 to 247; address 0 is a broadcast and is not answered."""
        if not all(1 <= address <= 247 for address in units):
            raise ValueError(f"unit addresses are 1 to 247, got {sorted(units)}")
        super().__init__(line)
        self.units = dict(units)
        self.receiver = RtuReceiver(settings or RtuSettings())
        line.attach(self._receive)

    def _receive(self, data: bytes, now: Second) -> None:
        for address, pdu in self.receiver.feed(data, now):
            if address == 0:
                for unit in self.units.values():
                    unit.serve(pdu, now)
            elif address in self.units:
                answer = self.units[address].serve(pdu, now)
                if answer is not None:
                    frame = encode_frame(address, answer.pdu)
                    asyncio.get_running_loop().call_later(answer.delay, self.line.send, frame)

    async def _poll_loop(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            for unit in self.units.values():
                unit.advance(loop.time())
            await asyncio.sleep(POLL_PERIOD)
