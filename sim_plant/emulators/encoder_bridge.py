"""The encoder bridge: latches motor and shaft encoder by one edge and sends both in one frame.

Source: docs/reference/wires.md (26 bytes, big-endian, CRC-16 polynomial 1021, start FFFF).
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
FRAME_SIZE = 26
MOTOR_SILENT, SHAFT_SILENT, SKIPPED, FIRST = 1 << 0, 1 << 1, 1 << 2, 1 << 3

FAULTS = {
    "wrong_crc": "the check sum of every frame is wrong",
    "silent": "no frame is sent; numbers and time continue",
    "restarted": "number and time restart with every frame, as in a bridge that resets",
    "stuck_sequence": "the frame number does not change",
    "wrong_version": "frames have version number 2",
}


class ShaftAngles(NamedTuple):
    """Angles of the encoder shafts at `time` on the source's own clock."""

    time: Second
    motor: Radian
    shaft: Radian


def crc16(data: bytes) -> int:
    """Return the frame's check sum: polynomial 1021, start FFFF, not reflected, no final xor."""
    crc = 0xFFFF
    for byte in data:
        crc ^= byte << 8
        for _ in range(8):
            crc = (crc << 1 ^ 0x1021 if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc


class BridgeSettings(NamedTuple):
    """Settings of a bridge."""

    rate: Hertz = 1000.0  # 0: edges only by pulse(), for a source that advances in steps
    start_us: int = 0  # clock at the start
    first_number: int = 0


class EncoderBridge(LineDevice):
    """Both encoders and the line; missed periods are skipped and flagged in the next frame."""

    def __init__(
        self,
        line: SerialLine,
        read: Callable[[], ShaftAngles],
        motor: Encoder,
        shaft: Encoder,
        settings: BridgeSettings | None = None,
    ) -> None:
        """`read` returns both angles at one instant and that time, which stamps the frame."""
        super().__init__(line)
        self.motor = motor
        self.shaft = shaft
        self.settings = settings or BridgeSettings()
        self.faults = DeviceFaults(FAULTS)
        self.skipped: Count = 0
        self._read = read
        self._number = self.settings.first_number
        self._flags = FIRST
        self._time_origin: Second | None = None
        self._last_time: Second = float("-inf")

    def pulse(self) -> None:
        """Latch once and send the frame."""
        frame = self.latch()
        if frame is not None:
            self.line.send(frame)

    def skip(self, periods: Count = 1) -> None:
        """Skip periods: their numbers stay unused, and the next frame has the SKIPPED flag."""
        self.skipped += periods
        self._number = self._number + periods & 0xFFFF
        self._flags |= SKIPPED

    def latch(self) -> bytes | None:
        """Return the frame of one edge; None if the source's time stands still or it is silent."""
        angles = self._read()
        if angles.time <= self._last_time:
            self.skip()
            return None
        if self.faults.is_on("restarted") or self._time_origin is None:
            self._time_origin = angles.time
            self._number = self.settings.first_number
            self._flags = FIRST
        self._last_time = angles.time
        frame = self._frame(angles)
        if not self.faults.is_on("stuck_sequence"):
            self._number = self._number + 1 & 0xFFFF
        if self.faults.is_on("silent"):
            return None
        self._flags = 0
        return frame

    def _frame(self, angles: ShaftAngles) -> bytes:
        assert self._time_origin is not None
        elapsed = angles.time - self._time_origin
        micros = self.settings.start_us + round(1.0e6 * elapsed)
        stamp = 1.0e-6 * micros  # the encoders' time stamps use the same clock
        latched = (self.motor.latch(angles.motor, stamp), self.shaft.latch(angles.shaft, stamp))
        silent = (MOTOR_SILENT, SHAFT_SILENT)
        flags = self._flags
        for word, bit in zip(latched, silent, strict=True):
            flags |= bit if word is None else 0
        body = struct.pack(
            ">BBHQBBII",
            VERSION + 1 if self.faults.is_on("wrong_version") else VERSION,
            flags,
            self._number,
            micros,
            self.motor.settings.protocol,
            self.shaft.settings.protocol,
            *(word or 0 for word in latched),
        )
        crc = crc16(body) ^ (0xFFFF if self.faults.is_on("wrong_crc") else 0)
        return SYNC + body + crc.to_bytes(2, "big")

    async def _poll_loop(self) -> None:
        if self.settings.rate <= 0.0:
            return  # edges come from pulse() only
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
