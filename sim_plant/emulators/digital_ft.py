"""The emulated ATI Digital F/T: Modbus-like requests, then a stream of gage samples, on RS-485.

Source: ATI 9610-05-1030 (Digital F/T): unit 10 at 1.25 MBd 8E1; function 6A unlocks, function 46
starts the stream of 13-byte samples, any 14 bytes on the bus stop it. Not confirmed, and
therefore parameters: the answer to the start request, and the status bit of a full-scale gage.
"""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Callable
from typing import NamedTuple

from sim_plant.emulators.ft_calibration import Calibration, Gages, Wrench, calibration_registers
from sim_plant.emulators.line_device import LineDevice
from sim_plant.emulators.modbus_pdu import ExceptionCode, ModbusRefusalError, Table, exception
from sim_plant.emulators.modbus_rtu import FRAME_LENGTHS, RtuReceiver, RtuSettings, encode_frame
from sim_plant.emulators.modbus_unit import Answer, ModbusUnit
from sim_plant.emulators.serial_line import SerialLine
from sim_plant.units import Count, Flag, Hertz, Second

STREAM, UNLOCK = 0x46, 0x6A
START_DATA, UNLOCK_DATA, LOCK_DATA, ACKNOWLEDGE = 0x55, 0xAA, 0x18, 0x01
ORDER = (0, 2, 4, 1, 3, 5)  # order of the gages in a sample
STOP_BYTES = 14  # bytes that end a stream
GAINS, OFFSETS, ERROR_WORD, CALIBRATION, STATUS = 0x0000, 0x0006, 0x001D, 0x00E3, 0x0027
MAX_BURST = 64  # most samples sent at once after a stall of the process; more are lost

FAULTS = {
    "saturated": "every gage reads full scale and the status bit is set",
    "status_error": "the status bit of every sample is set",
    "wrong_sum": "the 7-bit sum of every sample is wrong",
    "stream_stops": "the stream stops, as after a power dip",
    "deaf_to_jam": "the stream does not end",
    "gage_dead": "gage 3 reads its negative full scale",
}


class DigitalFtSettings(NamedTuple):
    """Settings of the sensor."""

    unit: int = 10
    rate: Hertz = 7000.0
    burst: Second = 0.001  # samples of this duration are sent together
    answers_start: Flag = 1
    saturation_in_status: Flag = 1
    calibration: Calibration = Calibration()
    reply_delay: Second = 0.0


class FtRegisters(ModbusUnit):
    """The sensor as a Modbus unit: calibration, gains, offsets, status, lock and start."""

    def __init__(self, settings: DigitalFtSettings, start: Callable[[], None]) -> None:
        """`start` is called when a host requests a stream."""
        super().__init__(
            faults=FAULTS,
            reply_delay=settings.reply_delay,
            functions=frozenset((3, 4, 6, 16, STREAM, UNLOCK)),
        )
        self.settings = settings
        self.unlocked = False
        self._start = start
        calibration = settings.calibration
        for first, values in (
            (GAINS, calibration.gains),
            (OFFSETS, calibration.offsets),
            (ERROR_WORD, (0,)),
            (CALIBRATION, calibration_registers(calibration)),
        ):
            for offset, value in enumerate(values):
                self.put(Table.HOLDING, first + offset, value)
        for offset in range(6):
            self.put(Table.INPUT, STATUS + offset, 0)
        self.writable = {(Table.HOLDING, address) for address in range(GAINS, OFFSETS + 6)}

    def accept_write(self, table: Table, address: int, value: int) -> None:
        """Write a gain or an offset while the storage is unlocked."""
        if not self.unlocked:
            raise ModbusRefusalError(ExceptionCode.DEVICE_FAILURE)
        self.put(table, address, value)

    def serve(self, pdu: bytes, now: Second) -> Answer | None:
        """Answer a request, including the manufacturer's own functions."""
        own_function = pdu[:1] in (bytes((STREAM,)), bytes((UNLOCK,)))
        if not own_function or any(
            self.faults.is_on(name) for name in ("silent", "refuses", "busy")
        ):
            return super().serve(pdu, now)
        delay = self.reply_delay + (self.late_by if self.faults.is_on("late_answers") else 0.0)
        function, data = pdu[0], pdu[1] if len(pdu) == 2 else -1
        if function == STREAM and data == START_DATA:
            self._start()
            return (
                Answer(bytes((function, ACKNOWLEDGE)), delay)
                if self.settings.answers_start
                else None
            )
        if function == UNLOCK and data in (UNLOCK_DATA, LOCK_DATA):
            self.unlocked = data == UNLOCK_DATA
            return Answer(bytes((function, ACKNOWLEDGE)), delay)
        return Answer(exception(function, ExceptionCode.ILLEGAL_VALUE), delay)


def encode_sample(gages: list[int], *, error: bool, wrong_sum: bool = False) -> bytes:
    """Return the 13 bytes of a sample; `gages` in order G0 to G5."""
    data = struct.pack(">6h", *(gages[gage] for gage in ORDER))
    total = sum(data) + wrong_sum & 0x7F
    return data + bytes((total | error << 7,))


class DigitalFt(LineDevice):
    """The sensor on its line."""

    def __init__(
        self,
        line: SerialLine,
        read: Callable[[], Wrench],
        settings: DigitalFtSettings | None = None,
    ) -> None:
        """`read` returns the present wrench."""
        super().__init__(line)
        self.settings = settings or DigitalFtSettings()
        self.registers = FtRegisters(self.settings, self._start_stream)
        self.faults = self.registers.faults
        self.streaming = False
        self.sent: Count = 0  # samples of this stream
        self._gages = Gages(self.settings.calibration)
        self._frozen_sample: tuple[list[int], bool] | None = None
        self._read = read
        own_lengths = {STREAM: 5, UNLOCK: 5}
        self._receiver = RtuReceiver(RtuSettings(lengths={**FRAME_LENGTHS, **own_lengths}))
        self._stop_bytes_received: Count = 0
        self._stream_start: Second = 0.0
        line.attach(self._receive)

    def samples(self, count: Count) -> bytes:
        """Return samples of the present wrench."""
        if self._frozen_sample is None or not self.faults.is_on("frozen_values"):
            self._frozen_sample = self._gages.read(self._read())
        gages, saturated = self._frozen_sample
        gages = list(gages)
        if self.faults.is_on("saturated"):
            gages, saturated = [32767] * 6, True
        if self.faults.is_on("gage_dead"):
            gages[3] = -32768
        error = self.faults.is_on("status_error")
        error = error or (saturated and self.settings.saturation_in_status == 1)
        return encode_sample(gages, error=error, wrong_sum=self.faults.is_on("wrong_sum")) * count

    def _start_stream(self) -> None:
        loop = asyncio.get_running_loop()
        self.streaming, self._stop_bytes_received, self.sent = True, 0, 0
        self._stream_start = loop.time() + self.settings.reply_delay + 0.001

    def _receive(self, data: bytes, now: Second) -> None:
        if self.streaming:
            self._stop_bytes_received += len(data)
            if self._stop_bytes_received >= STOP_BYTES and not self.faults.is_on("deaf_to_jam"):
                self.streaming = False
            return
        for address, pdu in self._receiver.feed(data, now):
            answer = self.registers.serve(pdu, now) if address == self.settings.unit else None
            if answer is not None:
                frame = encode_frame(address, answer.pdu)
                asyncio.get_running_loop().call_later(answer.delay, self.line.send, frame)

    async def _poll_loop(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            await asyncio.sleep(self.settings.burst)
            if not self.streaming:
                continue
            due = int((loop.time() - self._stream_start) * self.settings.rate) - self.sent
            if due > 0:
                self.sent += due
                if not self.faults.is_on("stream_stops") and not self.faults.is_on("silent"):
                    self.line.send(self.samples(min(due, MAX_BURST)))
