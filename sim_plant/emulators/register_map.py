"""A Modbus unit with any map of registers: a meter, an amplifier or a controller of a rig.

Source: Modbus application protocol V1.1b3, sections 4.3 and 4.4: four tables with addresses of
their own from 0; a register has 16 bits, high byte first. The protocol leaves to the manufacturer
how two registers form a number of 32 bits, so the order is a parameter of the unit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Literal, NamedTuple

from sim_plant.emulators.modbus_pdu import Table
from sim_plant.emulators.modbus_unit import ModbusUnit, WordOrder

Kind = Literal["bit", "u16", "i16", "u32", "i32", "f32"]

_RANGES = {
    "u16": (0, 0xFFFF), "i16": (-0x8000, 0x7FFF),
    "u32": (0, 0xFFFFFFFF), "i32": (-0x80000000, 0x7FFFFFFF),
}  # fmt: skip


class MappedValue(NamedTuple):
    """A measured value and its place."""

    table: Table
    address: int
    kind: Kind
    read: Callable[[], float]
    step: float = 1.0  # of the value per step of the registers
    fault: str = ""  # the fault that sets a switch to 1


class RegisterMap(NamedTuple):
    """All that a unit has in its tables, besides which every address is refused."""

    values: tuple[MappedValue, ...]
    unused: tuple[tuple[Table, int], ...] = ()  # addresses that read 0
    counters: tuple[tuple[Table, int], ...] = ()  # registers that count the samples
    outputs: Mapping[tuple[Table, int], Callable[[int], None]] = {}  # receive what is written
    stored: Mapping[int, int] = {}  # holding registers that keep what is written, from a value on


class RegisterMapUnit(ModbusUnit):
    """Samples its values with every request; integers saturate."""

    def __init__(self, registers: RegisterMap, *, word_order: WordOrder = "upper first") -> None:
        faults = {
            value.fault: f"register {value.address} reads 1"
            for value in registers.values
            if value.fault
        }
        super().__init__(faults=faults, word_order=word_order)
        self.samples = 0
        self._map = registers
        for place in (*registers.unused, *registers.outputs):
            self.put(*place, 0)
        for address, value in registers.stored.items():
            self.put(Table.HOLDING, address, value)
        self.writable |= set(registers.outputs)
        self.writable |= {(Table.HOLDING, address) for address in registers.stored}

    def measure(self, now: float) -> None:
        """Write a new sample to the tables."""
        self.samples += 1
        for place in self._map.counters:
            self.put(*place, self.samples & 0xFFFF)
        for value in self._map.values:
            self._put_value(value)

    def accept_write(self, table: Table, address: int, value: int) -> None:
        """Store a value, and pass it on if it is an output."""
        super().accept_write(table, address, value)
        output = self._map.outputs.get((table, address))
        if output is not None:
            output(value)

    def _put_value(self, value: MappedValue) -> None:
        table, address, kind, read, step, fault = value
        number = 1.0 if fault and self.faults.is_on(fault) else read() / step
        if kind == "bit":
            self.put(table, address, int(number != 0.0))
        elif kind == "f32":
            self.put_float(table, address, number)
        else:
            low, high = _RANGES[kind]
            whole = round(max(low, min(number, high))) if math.isfinite(number) else low
            if kind in ("u16", "i16"):
                self.put(table, address, whole & 0xFFFF)
            else:
                self._put_pair(table, address, (whole >> 16) & 0xFFFF, whole & 0xFFFF)
