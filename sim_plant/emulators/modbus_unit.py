"""One emulated Modbus unit: its tables, writable registers, faults and reply delay."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

from sim_plant.emulators import modbus_pdu
from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.emulators.modbus_pdu import ExceptionCode, ModbusRefusalError, Table
from sim_plant.units import Second

WordOrder = Literal["upper first", "lower first"]

FAULTS = {
    "silent": "no request is answered",
    "late_answers": "every answer comes `late_by` later",
    "refuses": "every request is answered by exception 4, device failure",
    "busy": "every request is answered by exception 6, busy",
    "half_busy": "every other request is answered by exception 6, busy",
    "frozen_values": "readings do not change; requests are answered as usual",
    "swapped_words": "32-bit values have their two words in the opposite order",
    "torn_values": "32-bit values have the lower word of the previous reading",
    "half_words": "the upper word of 32-bit values reads 0",
}
ALL_FUNCTIONS = frozenset((1, 2, 3, 4, 5, 6, 15, 16, 22, 23))


class Answer(NamedTuple):
    """Answer of a unit and its delay."""

    pdu: bytes
    delay: Second


class RegisterPair(NamedTuple):
    """A 32-bit value in two words, with its previous lower word."""

    upper: int
    lower: int
    lower_before: int


class ModbusUnit:
    """Base of the emulated units: a device overrides measure(), run_timers() and accept_write().

    Addresses are those on the wire, from 0. A read of a register that the device has not set, or a
    write outside `writable`, gets exception 2.
    """

    def __init__(
        self,
        *,
        faults: Mapping[str, str] | None = None,
        word_order: WordOrder = "upper first",
        reply_delay: Second = 0.0,
        late_by: Second = 0.5,
        functions: frozenset[int] = ALL_FUNCTIONS,
    ) -> None:
        """`faults` extend FAULTS; functions that are not in `functions` get exception 1."""
        self.faults = DeviceFaults({**FAULTS, **(faults or {})})
        self.word_order = word_order
        self.reply_delay = reply_delay
        self.late_by = late_by
        self.functions = functions
        self.requests = 0
        self.now: Second = 0.0
        self.writable: set[tuple[Table, int]] = set()
        self._registers: dict[tuple[Table, int], int] = {}
        self._pairs: dict[tuple[Table, int], RegisterPair] = {}

    def serve(self, pdu: bytes, now: Second) -> Answer | None:
        """Return the answer to a request, or None if the unit is silent. `now` never decreases."""
        self.advance(now)
        self.requests += 1
        if self.faults.is_on("silent") or not pdu:
            return None
        delay = self.reply_delay + (self.late_by if self.faults.is_on("late_answers") else 0.0)
        for fault, code in (
            ("refuses", ExceptionCode.DEVICE_FAILURE),
            ("busy", ExceptionCode.BUSY),
        ):
            if self.faults.is_on(fault):
                return Answer(modbus_pdu.exception(pdu[0], code), delay)
        if self.faults.is_on("half_busy") and self.requests % 2 == 0:
            return Answer(modbus_pdu.exception(pdu[0], ExceptionCode.BUSY), delay)
        if pdu[0] not in self.functions:
            return Answer(modbus_pdu.exception(pdu[0], ExceptionCode.ILLEGAL_FUNCTION), delay)
        self.on_request(pdu[0])
        return Answer(modbus_pdu.answer_request(self, pdu), delay)

    def advance(self, now: Second) -> None:
        """Advance the unit's own clocks to `now`."""
        self.now = now
        self.run_timers(now)
        if not self.faults.is_on("frozen_values"):
            self.measure(now)

    def run_timers(self, now: Second) -> None:
        """Run the device's own timers; they continue while its values are frozen."""

    def measure(self, now: Second) -> None:
        """Write new readings to the tables."""

    def on_request(self, function: int) -> None:
        """Called before a request with this function code is answered."""

    def should_disconnect(self) -> bool:
        """Return whether the device ends its connections now."""
        return False

    def accept_write(self, table: Table, address: int, value: int) -> None:
        """Write one value. Raises ModbusRefusalError if the value is not allowed."""
        self.put(table, address, value)

    def put(self, table: Table, address: int, value: int) -> None:
        """Set a bit or word."""
        self._registers[table, address] = value

    def put_float(self, table: Table, address: int, value: float) -> None:
        """Set an IEEE 754 float32 at two addresses; values beyond its range become infinite."""
        try:
            data = struct.pack(">f", value)
        except OverflowError:
            data = struct.pack(">f", float("inf") if value > 0.0 else float("-inf"))
        self._put_pair(table, address, *struct.unpack(">HH", data))

    def put_int32(self, table: Table, address: int, value: int) -> None:
        """Set a two's complement int32 at two addresses; values saturate."""
        clamped = max(-0x80000000, min(value, 0x7FFFFFFF))
        self._put_pair(table, address, *struct.unpack(">HH", struct.pack(">i", clamped)))

    def _put_pair(self, table: Table, address: int, upper: int, lower: int) -> None:
        previous = self._pairs.get((table, address))
        self._pairs[table, address] = RegisterPair(
            upper, lower, lower if previous is None else previous.lower
        )

    def read(self, table: Table, first: int, count: int) -> list[int]:
        """Return bits or words as they appear on the wire, faults included."""
        return [self._register(table, address) for address in range(first, first + count)]

    def write(self, table: Table, first: int, values: Sequence[int]) -> None:
        """Write values if all of their addresses are writable."""
        if any((table, first + offset) not in self.writable for offset in range(len(values))):
            raise ModbusRefusalError(ExceptionCode.ILLEGAL_ADDRESS)
        for offset, value in enumerate(values):
            self.accept_write(table, first + offset, value)

    def _register(self, table: Table, address: int) -> int:
        register = self._registers.get((table, address))
        if register is not None:
            return register
        for offset in (0, 1):
            pair = self._pairs.get((table, address - offset))
            if pair is not None:
                return self._ordered(pair)[offset]
        raise ModbusRefusalError(ExceptionCode.ILLEGAL_ADDRESS)

    def _ordered(self, pair: RegisterPair) -> tuple[int, int]:
        upper = 0 if self.faults.is_on("half_words") else pair.upper
        lower = pair.lower_before if self.faults.is_on("torn_values") else pair.lower
        upper_first = self.word_order == "upper first"
        if self.faults.is_on("swapped_words"):
            upper_first = not upper_first
        return (upper, lower) if upper_first else (lower, upper)
