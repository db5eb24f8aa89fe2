"""A terminal that is emulated from its description: process data, outputs, limits of numbers."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from sim_plant.emulators.ethercat.described_terminal import (
    DescribedPdo,
    DescribedTerminal,
    DescribedValue,
    ObjectSetting,
    TerminalDescription,
)
from sim_plant.emulators.ethercat.flywheel_bench import CarriageCommand, SlidingCarriage
from sim_plant.emulators.ethercat.process_data import ProcessData
from sim_plant.emulators.shared_simulation import SharedSimulation

STILL = SharedSimulation(SlidingCarriage(), CarriageCommand(), 0.001, lambda: 0.0)
INPUTS = DescribedPdo(
    0x1A00,
    (
        DescribedValue("status", 0x6000, 1, "u8"),
        DescribedValue("", 0, 0, "u8"),
        DescribedValue("samples", 0x6001, 1, "i16", 2),
        DescribedValue("power", 0x6002, 1, "f32"),
        DescribedValue("energy", 0x6002, 2, "f64"),
    ),
)
OUTPUTS = DescribedPdo(
    0, (DescribedValue("lamp", 0, 0, "bit"), DescribedValue("valve", 0, 0, "bit"))
)


def terminal(reads: dict[str, Any], writes: dict[str, Any]) -> DescribedTerminal:
    description = TerminalDescription((OUTPUTS,), (INPUTS,), (ObjectSetting(0x8000, 1, "u32"),))
    return DescribedTerminal((), description, reads, writes, STILL, lambda: 0.0)


@pytest.mark.parametrize(("sample", "stored"), [(-6.4, -6), (1e9, 32767), (-1e9, -32768)])
def test_inputs_are_packed_as_described(sample: float, stored: int) -> None:
    device = terminal({"samples": lambda: sample, "power": lambda: -2.5, "energy": lambda: 0.1}, {})
    device.step(0.0, 0.001)
    data = ProcessData(device.objects, lambda: False).inputs.pack()
    assert data == struct.pack("<BBhhfd", 0, 0, stored, stored, -2.5, 0.1)


def test_outputs_act_and_fall_with_the_master() -> None:
    seen: dict[str, float] = {}
    device = terminal({}, {"lamp": lambda v: seen.update(lamp=v),
                           "valve": lambda v: seen.update(valve=v)})  # fmt: skip
    data = ProcessData(device.objects, lambda: False)
    data.outputs.unpack(b"\x02")
    device.apply_outputs()
    assert seen == {"lamp": 0, "valve": 1}
    device.on_master_lost(0x1B)
    assert seen == {"lamp": 0, "valve": 0}
    assert data.outputs.pack() == b"\0"


def test_settings_can_be_written() -> None:
    device = terminal({}, {})
    device.objects.put(0x8000, 10_000, 1)
    assert device.objects.get(0x8000, 1) == 10_000
