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

TEND = 0.01  # s between two looks at the units' own timers
LONGEST = 256  # bytes of one frame
LENGTHS: Mapping[int, Count] = {**dict.fromkeys(range(1, 7), 8), 22: 10}
COUNTED: Mapping[int, Count] = {15: 6, 16: 6, 23: 10}  # where these functions say their size


def crc16(data: bytes) -> int:
    """Give the check sum of an RTU frame: polynomial 8005 reflected, start FFFF."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc


def framed(address: int, pdu: bytes) -> bytes:
    """Give the frame of an answer."""
    body = bytes((address,)) + pdu
    return body + crc16(body).to_bytes(2, "little")


class RtuSettings(NamedTuple):
    """How a line's units tell frames apart."""

    # Real units take 3.5 characters of silence as the end; a host's adapter and a busy machine
    # tear frames further apart than that, so silence that ends a frame is longer here.
    silence: Second = 0.02
    lengths: Mapping[int, Count] = LENGTHS  # whole frames, by function


class RtuReceiver:
    """Finds requests in what arrives; a wrong check sum spoils all up to the next silence."""

    def __init__(self, settings: RtuSettings) -> None:
        """Nothing has arrived yet."""
        self.settings = settings
        self.bad: Count = 0  # frames with a wrong check sum
        self.half: Count = 0  # frames that ended early
        self._buffer = b""
        self._spoilt = False
        self._last: Second = float("-inf")

    def feed(self, data: bytes, now: Second) -> list[tuple[int, bytes]]:
        """Give the requests that are complete now: address and PDU."""
        if now - self._last > self.settings.silence:
            self.half += 1 if self._buffer else 0
            self._buffer, self._spoilt = b"", False
        self._last = now
        if self._spoilt:
            return []
        self._buffer += data
        frames = []
        while not self._spoilt and (size := self._size()) and len(self._buffer) >= size:
            frame, self._buffer = self._buffer[:size], self._buffer[size:]
            if crc16(frame[:-2]) == int.from_bytes(frame[-2:], "little"):
                frames.append((frame[0], frame[1:-2]))
            else:
                self.bad += 1
                self._buffer, self._spoilt = b"", True
        return frames

    def _size(self) -> Count:
        """Size of the frame that begins the buffer; 0 while it cannot be told."""
        if len(self._buffer) < 2:
            return 0
        function = self._buffer[1]
        if function in COUNTED:
            place = COUNTED[function]
            return place + self._buffer[place] + 3 if len(self._buffer) > place else 0
        if function in self.settings.lengths:
            return self.settings.lengths[function]
        return self._told_by_check_sum()

    def _told_by_check_sum(self) -> Count:
        """A function nobody knows ends where its check sum fits, so it can be refused."""
        for size in range(4, min(len(self._buffer), LONGEST) + 1):
            body = self._buffer[:size]
            if crc16(body[:-2]) == int.from_bytes(body[-2:], "little"):
                return size
        return len(self._buffer) if len(self._buffer) >= LONGEST else 0


class RtuLine(LineDevice):
    """Units on one serial line. Nobody answers for an address that is not there."""

    def __init__(
        self,
        line: SerialLine,
        units: Mapping[int, ModbusUnit],
        settings: RtuSettings | None = None,
    ) -> None:
        """`units` by their address, 1 to 247; address 0 is for all, and is not answered."""
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
                    frame = framed(address, answer.pdu)
                    asyncio.get_running_loop().call_later(answer.delay, self.line.send, frame)

    async def _tend(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            for unit in self.units.values():
                unit.advance(loop.time())
            await asyncio.sleep(TEND)
