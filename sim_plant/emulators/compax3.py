"""The emulated Parker Compax3 on its serial line: answers binary records and ASCII lines.

Source: Parker manuals 192-1201xx, "Control via RS232 / RS485 / USB".
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable

from sim_plant.emulators import compax3_records as records
from sim_plant.emulators.compax3_drive import Compax3Drive, Compax3RefusalError, DriveInput
from sim_plant.emulators.compax3_objects import OBJECTS, Compax3Settings, ObjectNumber
from sim_plant.emulators.compax3_records import Record, RecordReceiver
from sim_plant.emulators.line_device import LineDevice
from sim_plant.emulators.serial_line import SerialLine
from sim_plant.units import Second

POLL_PERIOD = 0.005  # s between two updates from the plant

_NUMBER = r"(\$[0-9A-F]+|\d+)"
_OBJECT = re.compile(
    rf"(?P<address>\d{{1,2}})?O{_NUMBER}[.,]{_NUMBER}(?:=(?P<value>[^$]\S*|\$[0-9A-F]+))?(?P<hex>\$)?"
)
_IDENTIFY = re.compile(r"(?P<address>\d{1,2})?_\?")


class Compax3(LineDevice):
    """The drive on its serial line, connected to a plant."""

    def __init__(
        self,
        line: SerialLine,
        read: Callable[[], DriveInput],
        write: Callable[[str, float], None],
        settings: Compax3Settings | None = None,
    ) -> None:
        """`write` receives `enabled` (0, 1), `velocity` (rad/s at the motor), `torque` (N m)."""
        super().__init__(line)
        self.settings = settings or Compax3Settings()
        self.drive = Compax3Drive(self.settings, read, write)
        self.faults = self.drive.faults
        self.receiver = RecordReceiver()
        line.attach(self._receive)

    def answer(self, message: Record | str, now: Second) -> bytes | None:
        """Return the answer to one record or line; None if the drive does not answer."""
        if isinstance(message, Record):
            own = self.settings.address
            if own is not None and message.address != own:
                return None
            reply = self._record_answer(message, now)
            if self.faults.is_on("wrong_crc"):
                reply = reply[:-1] + bytes((reply[-1] ^ 0xFF,))
        else:
            text = self._line_answer(message, now)
            if text is None:
                return None
            star = "*" if self.settings.address is not None else ""
            reply = f"{star}{text}\r".encode("ascii")
        return None if self.faults.is_on("silent") else reply

    def _record_answer(self, message: Record, now: Second) -> bytes:
        refusals = self.settings.refusals
        if not message.crc_ok:
            return records.encode_refusal(refusals.bad_sum)
        if self.faults.is_on("refuses"):
            return records.encode_refusal(refusals.bad_value)
        self.drive.restart_host_timeout(now)
        self.drive.advance(now)
        plc = bool(message.start & records.PLC)
        try:
            if message.start & records.KIND == records.READ:
                return records.encode_record(
                    records.RESPONSE, self._read_objects(message.data, plc)
                )
            number = self._object_number(message.data[:3])
            value = records.decode_value(OBJECTS[number].format, message.data[3:], plc=plc)
            if value is None:
                return records.encode_refusal(refusals.bad_value)
            self.drive.set(number, value)
        except Compax3RefusalError as refusal:
            return records.encode_refusal(refusal.code)
        self.drive.advance(now)
        return records.encode_record(records.ACKNOWLEDGED, b"\0\0")

    def _read_objects(self, data: bytes, plc: bool) -> bytes:
        """Return the concatenated values of one or several objects."""
        if len(data) % 3:
            raise Compax3RefusalError(self.settings.refusals.bad_syntax)
        numbers = [
            self._object_number(data[offset : offset + 3]) for offset in range(0, len(data), 3)
        ]
        return b"".join(
            records.encode_value(OBJECTS[number].format, self.drive.get(number), plc=plc)
            for number in numbers
        )

    def _object_number(self, data: bytes) -> ObjectNumber:
        if len(data) != 3:
            raise Compax3RefusalError(self.settings.refusals.bad_syntax)
        number = int.from_bytes(data[:2], "big"), data[2]
        if number not in OBJECTS:
            raise Compax3RefusalError(self.settings.refusals.no_such_object)
        return number

    def _line_answer(self, line: str, now: Second) -> str | None:
        text = line.replace(" ", "").upper()
        matched = _OBJECT.fullmatch(text) or _IDENTIFY.fullmatch(text)
        if matched is None:
            return f"!{self.settings.refusals.bad_syntax:04X}"
        address = matched["address"]
        if self.settings.address is not None and (
            address is None or int(address) != self.settings.address
        ):
            return None
        if self.faults.is_on("refuses"):
            return f"!{self.settings.refusals.bad_value:04X}"
        self.drive.restart_host_timeout(now)
        self.drive.advance(now)
        if matched.re is _IDENTIFY:
            return self.settings.name
        try:
            number = _parse_integer(matched[2]), _parse_integer(matched[3])
            if matched["value"] is None:
                return _format_value(self.drive.get(number), hexadecimal=matched["hex"] is not None)
            self.drive.set(number, self._parse_value(matched["value"]))
        except Compax3RefusalError as refusal:
            return f"!{refusal.code:04X}"
        self.drive.advance(now)
        return ">"

    def _parse_value(self, text: str) -> float:
        try:
            return float(_parse_integer(text)) if text.startswith("$") else float(text)
        except ValueError:
            raise Compax3RefusalError(self.settings.refusals.bad_value) from None

    def _receive(self, data: bytes, now: Second) -> None:
        loop = asyncio.get_running_loop()
        for message in self.receiver.feed(data, now):
            reply = self.answer(message, now)
            if reply is not None:
                extra_delay = self.settings.late_by if self.faults.is_on("late_answers") else 0.0
                loop.call_later(self.settings.reply_delay + extra_delay, self.line.send, reply)

    async def _poll_loop(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            self.drive.advance(loop.time())
            await asyncio.sleep(POLL_PERIOD)


def _parse_integer(text: str) -> int:
    return int(text[1:], 16) if text.startswith("$") else int(text)


def _format_value(value: float, *, hexadecimal: bool) -> str:
    if hexadecimal:
        return f"${round(value) & 0xFFFFFFFF:X}"
    return f"{value:.6f}".rstrip("0").rstrip(".") if value % 1.0 else f"{value:.0f}"
