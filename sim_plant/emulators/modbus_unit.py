"""One emulated Modbus unit: its tables, what may be written, its faults and how late it answers."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Literal, NamedTuple

from sim_plant.emulators import modbus_pdu
from sim_plant.emulators.device_faults import DeviceFaults
from sim_plant.emulators.modbus_pdu import RefusalError, Refused, Table
from sim_plant.units import Second

WordOrder = Literal["upper first", "lower first"]

FAULTS = {
    "silent": "no request is answered",
    "late_answers": "every answer comes `late_by` later",
    "refuses": "every request is answered by exception 4, device failure",
    "busy": "every request is answered by exception 6, busy",
    "half_busy": "every other request is answered by exception 6, busy",
    "frozen_values": "readings stand still; requests are answered as ever",
    "swapped_words": "32-bit values have their two words in the other order",
    "torn_values": "32-bit values have the lower word of the reading before",
    "half_words": "the upper word of 32-bit values reads 0",
}
ALL_FUNCTIONS = frozenset((1, 2, 3, 4, 5, 6, 15, 16, 22, 23))


class Answer(NamedTuple):
    """What a unit answers, and how long it takes to."""

    pdu: bytes
    delay: Second


class Pair(NamedTuple):
    """A 32-bit value in two words, with the lower word it had before."""

    upper: int
    lower: int
    lower_before: int


class ModbusUnit:
    """Base of the emulated units: a device overrides measure(), run() and accept().

    Addresses are those of the wire, from 0. What no device put into the tables does not exist
    and is answered by exception 2; so is a write outside `writable`.
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
        """`faults` are those of the device beyond FAULTS; other functions get exception 1."""
        self.faults = DeviceFaults({**FAULTS, **(faults or {})})
        self.word_order = word_order
        self.reply_delay = reply_delay
        self.late_by = late_by
        self.functions = functions
        self.requests = 0
        self.now: Second = 0.0
        self.writable: set[tuple[Table, int]] = set()
        self._words: dict[tuple[Table, int], int] = {}
        self._pairs: dict[tuple[Table, int], Pair] = {}

    def serve(self, pdu: bytes, now: Second) -> Answer | None:
        """Answer one request, or give None where the unit is silent. `now` never goes back."""
        self.advance(now)
        self.requests += 1
        if self.faults.on("silent") or not pdu:
            return None
        delay = self.reply_delay + (self.late_by if self.faults.on("late_answers") else 0.0)
        for fault, code in (("refuses", Refused.DEVICE_FAILURE), ("busy", Refused.BUSY)):
            if self.faults.on(fault):
                return Answer(modbus_pdu.exception(pdu[0], code), delay)
        if self.faults.on("half_busy") and self.requests % 2 == 0:
            return Answer(modbus_pdu.exception(pdu[0], Refused.BUSY), delay)
        if pdu[0] not in self.functions:
            return Answer(modbus_pdu.exception(pdu[0], Refused.ILLEGAL_FUNCTION), delay)
        self.heard(pdu[0])
        return Answer(modbus_pdu.answer(self, pdu), delay)

    def advance(self, now: Second) -> None:
        """Let the unit's own clocks run on to `now`."""
        self.now = now
        self.run(now)
        if not self.faults.on("frozen_values"):
            self.measure(now)

    def run(self, now: Second) -> None:
        """Timers of the device's own; they run on while its values are frozen."""

    def measure(self, now: Second) -> None:
        """Put new readings into the tables."""

    def heard(self, function: int) -> None:
        """A request with this function code is about to be answered."""

    def hangs_up(self) -> bool:
        """Say whether the device ends its connections now."""
        return False

    def accept(self, table: Table, address: int, value: int) -> None:
        """Take one written value; RefusalError if it may not have it."""
        self.put(table, address, value)

    def put(self, table: Table, address: int, value: int) -> None:
        """Set a bit or word."""
        self._words[table, address] = value

    def put_float(self, table: Table, address: int, value: float) -> None:
        """Set an IEEE 754 float32 at two addresses; beyond its range it is infinite."""
        try:
            data = struct.pack(">f", value)
        except OverflowError:
            data = struct.pack(">f", float("inf") if value > 0.0 else float("-inf"))
        self._put_pair(table, address, *struct.unpack(">HH", data))

    def put_int32(self, table: Table, address: int, value: int) -> None:
        """Set a two's complement int32 at two addresses; it saturates."""
        held = max(-0x80000000, min(value, 0x7FFFFFFF))
        self._put_pair(table, address, *struct.unpack(">HH", struct.pack(">i", held)))

    def _put_pair(self, table: Table, address: int, upper: int, lower: int) -> None:
        before = self._pairs.get((table, address))
        self._pairs[table, address] = Pair(upper, lower, lower if before is None else before.lower)

    def read(self, table: Table, first: int, count: int) -> list[int]:
        """Give bits or words as the wire sees them, faults included."""
        return [self._word(table, address) for address in range(first, first + count)]

    def write(self, table: Table, first: int, values: Sequence[int]) -> None:
        """Take values where every one of their addresses is writable."""
        if any((table, first + place) not in self.writable for place in range(len(values))):
            raise RefusalError(Refused.ILLEGAL_ADDRESS)
        for place, value in enumerate(values):
            self.accept(table, first + place, value)

    def _word(self, table: Table, address: int) -> int:
        word = self._words.get((table, address))
        if word is not None:
            return word
        for place in (0, 1):
            pair = self._pairs.get((table, address - place))
            if pair is not None:
                return self._ordered(pair)[place]
        raise RefusalError(Refused.ILLEGAL_ADDRESS)

    def _ordered(self, pair: Pair) -> tuple[int, int]:
        upper = 0 if self.faults.on("half_words") else pair.upper
        lower = pair.lower_before if self.faults.on("torn_values") else pair.lower
        upper_first = self.word_order == "upper first"
        if self.faults.on("swapped_words"):
            upper_first = not upper_first
        return (upper, lower) if upper_first else (lower, upper)
