"""A power analyser on Modbus TCP: the register map of a Yokogawa WT310E/WT330E.

Source: IM WT310-17EN, section 9 (functions 03, 04, 06; input registers, numbered from 1, one less
on the wire: 0001-0012 status, 0101-0194, 0201-0294, 0301-0394 elements, 0401-0446 sum, 2001-2510
output items; holding 0001-0010 control; float32, upper word first). Not confirmed, and therefore
parameters: the positions of status, counter and control in their blocks, and the order in an
element's block.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Literal, NamedTuple

from sim_plant.emulators.modbus_pdu import ExceptionCode, ModbusRefusalError, Table
from sim_plant.emulators.modbus_unit import ModbusUnit, WordOrder
from sim_plant.units import Ampere, Count, Hertz, Second, Volt, Watt

Block = Literal["element_1", "element_2", "element_3", "sum"]
Quantity = Literal["U", "I", "P", "S", "Q", "lambda", "phi", "fU", "fI"]

BLOCKS: dict[Block, tuple[int, Count]] = {  # first register on the wire, number of floats
    "element_1": (100, 47),
    "element_2": (200, 47),
    "element_3": (300, 47),
    "sum": (400, 23),
}
ITEMS = (2000, 255)
ORDER: tuple[Quantity, ...] = ("U", "I", "P", "S", "Q", "lambda", "phi", "fU", "fI")
ITEMS_1: tuple[tuple[Block, Quantity], ...] = tuple(("element_1", name) for name in ORDER)
STATUS = (0, 12)
CONTROL = (0, 10)
NO_DATA = float("nan")  # reading of an item without a function (IM WT310-17EN shows NAN)

FAULTS = {
    "over_range": "every value reads infinite, as an input beyond its range does",
    "counter_stuck": "values continue to change, the update counter does not",
    "stuck_values": "values do not change, the update counter continues",
    "no_data": "every value reads not-a-number",
}


class TerminalValues(NamedTuple):
    """Quantities at the terminals of one element (or the sum of elements)."""

    voltage: Volt = 0.0
    current: Ampere = 0.0
    power: Watt = 0.0  # sign by the rig's wiring
    frequency: Hertz = 0.0


class Terminals(NamedTuple):
    """Inputs of the analyser at `time` on the source's own clock."""

    time: Second
    element_1: TerminalValues = TerminalValues()
    element_2: TerminalValues = TerminalValues()
    element_3: TerminalValues = TerminalValues()
    sum: TerminalValues = TerminalValues()


class AnalyserSettings(NamedTuple):
    """Settings of the analyser."""

    update_period: Second = 0.1  # 0: the source has its own period, each new `time` is an update
    lag: Second = 0.0  # from the end of an averaging period until its means are readable
    items: tuple[tuple[Block, Quantity], ...] = ITEMS_1  # as delivered
    word_order: WordOrder = "upper first"
    counter_register: int = 1  # among the status registers, on the wire; not confirmed
    clock_register: int = 2  # upper word of ms since the start; not confirmed
    order: tuple[Quantity, ...] = ORDER  # within the block of an element; not confirmed


class PowerAnalyser(ModbusUnit):
    """Publishes means over its own periods after a lag, with an update counter."""

    def __init__(
        self,
        read: Callable[[], Terminals],
        settings: AnalyserSettings | None = None,
        *,
        reply_delay: Second = 0.0,
    ) -> None:
        """`read` returns present values or, with `update_period` 0, the source's last means."""
        self.settings = settings or AnalyserSettings()
        super().__init__(
            faults=FAULTS,
            word_order=self.settings.word_order,
            reply_delay=reply_delay,
            functions=frozenset((3, 4, 6)),
        )
        self._read = read
        self._sums: list[Terminals] = []
        self._period: int | None = None
        self._pending: list[tuple[Second, Terminals]] = []
        self._last_time: Second | None = None
        self._start: Second | None = None
        self.updates: Count = 0
        self._published = Terminals(0.0)
        for address in range(STATUS[0], STATUS[0] + STATUS[1]):
            self.put(Table.INPUT, address, 0)
        for address in range(CONTROL[0], CONTROL[0] + CONTROL[1]):
            self.put(Table.HOLDING, address, 0)
            self.writable.add((Table.HOLDING, address))
        for first, size in (*BLOCKS.values(), ITEMS):
            for index in range(size):
                self.put_float(Table.INPUT, first + 2 * index, NO_DATA)
        self._publish(Terminals(0.0), 0.0, count=0)

    def accept_write(self, table: Table, address: int, value: int) -> None:
        """Write a control word: hold, integration start and stop are 0 or 1 here."""
        if value > 1:
            raise ModbusRefusalError(ExceptionCode.ILLEGAL_VALUE)
        self.put(table, address, value)

    def measure(self, now: Second) -> None:
        """Average, and publish the means that are due."""
        self._start = now if self._start is None else self._start
        present = self._read()
        if self.settings.update_period <= 0.0:
            if self._last_time is None or present.time - self._last_time > 1.0e-4:
                self._last_time = present.time
                self._pending.append((now + self.settings.lag, present))
        else:
            self._average(present, now)
        while self._pending and self._pending[0][0] <= now:
            self._publish(self._pending.pop(0)[1], now, count=1)

    def _average(self, present: Terminals, now: Second) -> None:
        period = math.floor(now / self.settings.update_period)
        if self._period is not None and period != self._period and self._sums:
            due = (self._period + 1) * self.settings.update_period + self.settings.lag
            self._pending.append((due, mean(self._sums)))
            self._sums = []
        self._period = period
        self._sums.append(present)

    def _publish(self, values: Terminals, now: Second, *, count: Count) -> None:
        settings = self.settings
        if self.faults.is_on("stuck_values"):
            values = self._published
        self._published = values
        blocks = {block: self._apply_faults(quantities(getattr(values, block))) for block in BLOCKS}
        for block, (first, _) in BLOCKS.items():
            for index, quantity in enumerate(settings.order):
                self.put_float(Table.INPUT, first + 2 * index, blocks[block][quantity])
        for index, (block, quantity) in enumerate(settings.items):
            self.put_float(Table.INPUT, ITEMS[0] + 2 * index, blocks[block][quantity])
        self.updates += count
        if not self.faults.is_on("counter_stuck"):
            self.put(Table.INPUT, settings.counter_register, self.updates & 0xFFFF)
        clock = int(1000.0 * (now - (self._start or now))) & 0xFFFFFFFF
        self.put(Table.INPUT, settings.clock_register, clock >> 16)
        self.put(Table.INPUT, settings.clock_register + 1, clock & 0xFFFF)

    def _apply_faults(self, values: dict[Quantity, float]) -> dict[Quantity, float]:
        if self.faults.is_on("no_data"):
            return dict.fromkeys(values, NO_DATA)
        if self.faults.is_on("over_range"):
            return dict.fromkeys(values, float("inf"))
        return values


def quantities(terminal: TerminalValues) -> dict[Quantity, float]:
    """Return the quantities that the analyser derives: V, A, W, V A, var, 1, degrees, Hz."""
    voltage, current, power, frequency = terminal
    apparent = voltage * current
    factor = power / apparent if apparent > 0.0 else 0.0
    clamped = max(-1.0, min(factor, 1.0))
    return {
        "U": voltage,
        "I": current,
        "P": power,
        "S": apparent,
        "Q": math.sqrt(max(apparent * apparent - power * power, 0.0)),
        "lambda": factor,
        "phi": math.degrees(math.acos(clamped)),
        "fU": frequency,
        "fI": frequency,
    }


def mean(samples: list[Terminals]) -> Terminals:
    """Return the means of each quantity; the time is that of the last sample."""
    count = len(samples)

    def of(block: Block) -> TerminalValues:
        terminals: list[TerminalValues] = [getattr(sample, block) for sample in samples]
        return TerminalValues(*(sum(values) / count for values in zip(*terminals, strict=True)))

    last = samples[-1].time
    return Terminals(last, of("element_1"), of("element_2"), of("element_3"), of("sum"))
