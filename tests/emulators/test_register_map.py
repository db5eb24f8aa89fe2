"""An emulated unit with any map of registers: bytes on the wire, saturation, outputs, faults."""

from __future__ import annotations

import math
import struct

import pytest

from sim_plant.emulators.modbus_pdu import ModbusRefusalError, Table
from sim_plant.emulators.register_map import Kind, MappedValue, RegisterMap, RegisterMapUnit


def registers(kind: Kind, number: float, step: float = 1.0, **options: object) -> list[int]:
    """Return the registers of one value at address 5."""
    values = (MappedValue(Table.INPUT, 5, kind, lambda: number, step),)
    unit = RegisterMapUnit(RegisterMap(values), **options)  # type: ignore[arg-type]
    unit.advance(1.0)
    return unit.read(Table.INPUT, 5, 1 if kind in ("u16", "i16") else 2)


@pytest.mark.parametrize(
    ("kind", "code", "number", "raw"),
    [
        ("u16", ">H", 12.0, 12), ("u16", ">H", -1.0, 0), ("u16", ">H", 1e9, 0xFFFF),
        ("i16", ">h", -7.4, -7), ("i16", ">h", -1e9, -0x8000), ("i16", ">h", math.nan, -0x8000),
        ("u32", ">I", 3e9, 3_000_000_000), ("i32", ">i", -70_000.0, -70_000),
        ("i32", ">i", math.inf, -0x80000000), ("f32", ">f", -0.15625, -0.15625),
    ],
)  # fmt: skip
def test_bytes_are_those_of_the_format(kind: Kind, code: str, number: float, raw: float) -> None:
    words = registers(kind, number)
    assert struct.pack(f">{len(words)}H", *words) == struct.pack(code, raw)


def test_step_and_word_order() -> None:
    assert registers("i32", -0.5, 1e-6) == [0xFFF8, 0x5EE0]  # -500000
    assert registers("i32", -0.5, 1e-6, word_order="lower first") == [0x5EE0, 0xFFF8]


def test_only_the_places_of_the_map_answer() -> None:
    unit = RegisterMapUnit(
        RegisterMap(
            (MappedValue(Table.INPUT, 0, "u16", lambda: 4.0),),
            unused=((Table.INPUT, 1),),
            counters=((Table.INPUT, 9),),
        )
    )
    for _ in range(3):
        unit.advance(1.0)
    assert unit.read(Table.INPUT, 0, 2) == [4, 0]
    assert unit.read(Table.INPUT, 9, 1) == [3]
    for table, address in ((Table.INPUT, 2), (Table.HOLDING, 0)):
        with pytest.raises(ModbusRefusalError):
            unit.read(table, address, 1)


def test_outputs_are_passed_on_and_other_registers_stored() -> None:
    written: list[int] = []
    outputs = {(Table.HOLDING, 3): written.append}
    unit = RegisterMapUnit(RegisterMap((), outputs=outputs, stored={0x1000: 0, 0x1006: 1}))
    unit.write(Table.HOLDING, 3, [1])
    unit.write(Table.HOLDING, 0x1000, [5])
    assert written == [1]
    assert [unit.read(Table.HOLDING, at, 1)[0] for at in (3, 0x1000, 0x1006)] == [1, 5, 1]
    with pytest.raises(ModbusRefusalError):
        unit.write(Table.HOLDING, 4, [1])


def test_a_fault_forces_its_bit() -> None:
    value = MappedValue(Table.DISCRETE_INPUTS, 1, "bit", lambda: 0.0, fault="e_stop_on")
    unit = RegisterMapUnit(RegisterMap((value,)))
    for on in (False, True, False):
        unit.faults.switch("e_stop_on", on)
        unit.advance(1.0)
        assert unit.read(Table.DISCRETE_INPUTS, 1, 1) == [int(on)]
