"""The encoder bridge: clocks motor and shaft encoder by one edge and sends both in one frame.

Source: docs/encoder_bridge.md (26 bytes, big-endian, CRC-16 polynomial 1021, start FFFF).
"""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Callable
from typing import NamedTuple

from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.emulators.encoder_words import Encoder
from sim_plant.emulators.line_device import LineDevice
from sim_plant.emulators.serial_line import SerialLine
from sim_plant.units import Count, Hertz, Radian, Second

SYNC = b"\xeb\x90"
VERSION = 1
SIZE = 26
MOTOR_SILENT, SHAFT_SILENT, SKIPPED, FIRST = 1 << 0, 1 << 1, 1 << 2, 1 << 3

FAULTS = {
    "wrong_crc": "the check sum of every frame is wrong",
    "silent": "no frame is sent; numbers and time run on",
    "restarted": "number and time begin anew with every frame, as a bridge that resets",
    "stuck_sequence": "the number of the frames stands still",
    "wrong_version": "frames say they are of version 2",
}


class Angles(NamedTuple):
    """What the encoders' shafts do at `time` on the source's own clock."""

    time: Second
    motor: Radian
    shaft: Radian


def crc16(data: bytes) -> int:
    """Give the frame's check sum: polynomial 1021, start FFFF, not reflected, no final xor."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


class BridgeSettings(NamedTuple):
    """How a bridge is set."""

    rate: Hertz = 1000.0  # 0: no edge but those of pulse(), for a source that moves in steps
    start_us: int = 0  # its clock when it starts
    first_number: int = 0


class EncoderBridge(LineDevice):
    """Both encoders and the line; a period that cannot be kept is skipped and said so."""

    def __init__(
        self,
        line: SerialLine,
        read: Callable[[], Angles],
        motor: Encoder,
        shaft: Encoder,
        settings: BridgeSettings | None = None,
    ) -> None:
        """`read` gives both angles of one moment, and that moment: it stamps the frame."""
        super().__init__(line)
        self.motor = motor
        self.shaft = shaft
        self.settings = settings or BridgeSettings()
        self.faults = DeviceFaults(FAULTS)
        self.skipped: Count = 0
        self._read = read
        self._number = self.settings.first_number
        self._flags = FIRST
        self._origin: Second | None = None
        self._last: Second = float("-inf")

    def pulse(self) -> None:
        """Latch once and send."""
        frame = self.latch()
        if frame is not None:
            self.line.send(frame)

    def skip(self, periods: Count = 1) -> None:
        """Leave out periods: their numbers are not used, and the next frame says so."""
        self.skipped += periods
        self._number = self._number + periods & 0xFFFF
        self._flags |= SKIPPED

    def latch(self) -> bytes | None:
        """Give one edge's frame; None where the source's time stands, or the bridge is silent."""
        angles = self._read()
        if angles.time <= self._last:
            self.skip()
            return None
        if self.faults.on("restarted") or self._origin is None:
            self._origin = angles.time
            self._number = self.settings.first_number
            self._flags = FIRST
        self._last = angles.time
        frame = self._frame(angles)
        if not self.faults.on("stuck_sequence"):
            self._number = self._number + 1 & 0xFFFF
        if self.faults.on("silent"):
            return None
        self._flags = 0
        return frame

    def _frame(self, angles: Angles) -> bytes:
        assert self._origin is not None
        elapsed = angles.time - self._origin
        micros = self.settings.start_us + round(1.0e6 * elapsed)
        moment = 1.0e-6 * micros  # the encoders' stamps are of the same clock
        words = (self.motor.latch(angles.motor, moment), self.shaft.latch(angles.shaft, moment))
        silent = (MOTOR_SILENT, SHAFT_SILENT)
        flags = self._flags
        for word, bit in zip(words, silent, strict=True):
            flags |= bit if word is None else 0
        body = struct.pack(
            ">BBHQBBII",
            VERSION + 1 if self.faults.on("wrong_version") else VERSION,
            flags,
            self._number,
            micros,
            self.motor.settings.protocol,
            self.shaft.settings.protocol,
            *(word or 0 for word in words),
        )
        crc = crc16(body) ^ (0xFFFF if self.faults.on("wrong_crc") else 0)
        return SYNC + body + crc.to_bytes(2, "big")

    async def _tend(self) -> None:
        if self.settings.rate <= 0.0:
            return  # edges are those of pulse()
        loop = asyncio.get_running_loop()
        period = 1.0 / self.settings.rate
        start, edges = loop.time(), 0
        while True:
            await asyncio.sleep(start + (edges + 1) * period - loop.time())
            due = int((loop.time() - start) / period + 1.0e-6)
            if due > edges + 1:
                self.skip(due - edges - 1)
            edges = max(due, edges + 1)
            self.pulse()
