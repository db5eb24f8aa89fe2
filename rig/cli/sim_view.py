"""The emulated devices of a rig and their addresses, for people and programs."""

import itertools
import json
import sys
from collections.abc import Iterable
from typing import Any, NamedTuple

from rich.table import Table
from rich.text import Text

from rig.cli.console import table_console
from rig.config.wiring import SLOT_SIGNALS, AnyLine, Registers, TcpLine, Wiring
from rig.emulation.addresses import AnyWiring, can_address
from rig.kinds.oswec_bench.config.wiring import BENCH_SLOT_SIGNALS, BenchWiring, SerialPort

_DRIVE_DESCRIPTIONS = {
    "amc": "torque drive, AMC scaling",
    "rated_torque": "torque drive, scaled by its rated torque",
    "rated_current": "torque drive, scaled by its rated current",
}
_UNIT_DESCRIPTIONS = {
    "analyser": "power analyser",
    "cells": "strain-gauge amplifier: load cells",
    "probes": "strain-gauge amplifier: wave probes",
    "inputs": "I/O coupler: digital inputs",
    "outputs": "I/O coupler: digital outputs",
    "analog": "I/O coupler: analog outputs for servo and brake",
    "brake": "measuring amplifier: current of the brake",
}


class EmulatedDevice(NamedTuple):
    """An emulated device on a wire."""

    wire: str  # CAN, or the name of the line
    protocol: str  # protocol
    address: str
    number: int  # of the node or unit
    name: str
    description: str


def emulated_devices(wiring: AnyWiring) -> list[EmulatedDevice]:
    """Return every emulated device with its address."""
    if isinstance(wiring, BenchWiring):
        return [*_streams(wiring), *_modbus_units(wiring, wiring.lines, BENCH_SLOT_SIGNALS)]
    return [*_can_nodes(wiring), *_modbus_units(wiring, wiring.lines, SLOT_SIGNALS)]


def _can_nodes(wiring: Wiring) -> list[EmulatedDevice]:
    can = wiring.can
    bus = "{}:{}".format(*can_address(can))
    return [
        EmulatedDevice("CAN", f"socketcand {can.channel}", bus, drive.node, name, description)
        for name, drive, description in (
            ("heave", wiring.heave, _DRIVE_DESCRIPTIONS[wiring.heave.scaling]),
            ("surge", wiring.surge, _DRIVE_DESCRIPTIONS[wiring.surge.scaling]),
            ("stator", wiring.stator, "actuator: profile position, homing"),
        )
    ]


def _streams(wiring: BenchWiring) -> list[EmulatedDevice]:
    encoders, servo, cell = wiring.encoders, wiring.servo, wiring.load_cell
    address = servo.address or 0
    return [
        EmulatedDevice(
            "encoders", _serial_text(encoders), encoders.port, 0, "encoders", "encoder bridge"
        ),
        EmulatedDevice(
            "servo", _serial_text(servo), servo.port, address, "servo", "servo drive, Compax3"
        ),
        EmulatedDevice(
            "load cell", "RDT over UDP", f"{cell.host}:{cell.port}", 0, "load_cell", "ATI Net F/T"
        ),
    ]


def _serial_text(port: SerialPort) -> str:
    return f"serial, {port.baud} baud 8{port.parity}{port.stop_bits},"


def _modbus_units(
    wiring: AnyWiring, lines: dict[str, AnyLine], slots: Iterable[str]
) -> list[EmulatedDevice]:
    devices = []
    for line_name, line in lines.items():
        if isinstance(line, TcpLine):
            protocol, address = "Modbus TCP", f"{line.host}:{line.port}"
        else:
            protocol = f"Modbus RTU, {line.baud} baud 8{line.parity}{line.stop_bits},"
            address = line.port
        for name in slots:
            block: Registers = getattr(wiring, name)
            if block.line == line_name:
                devices.append(
                    EmulatedDevice(
                        line_name, protocol, address, block.unit, name, _UNIT_DESCRIPTIONS[name]
                    )
                )
    return devices


def show(rig: str, devices: list[EmulatedDevice], setting: str, *, as_json: bool) -> None:
    """Print the devices: one line of JSON, or a table per wire."""
    if as_json:
        data: dict[str, Any] = {
            "status": "ready",
            "rig": rig,
            "sea": setting,
            "devices": [device._asdict() for device in devices],
        }
        print(json.dumps(data, ensure_ascii=False), flush=True)
        return
    console = table_console()
    console.print(Text.assemble("\n", (rig, "bold"), f": emulated devices in {setting}\n"))
    for wire, group in itertools.groupby(
        devices, lambda device: (device.wire, device.protocol, device.address)
    ):
        modbus = wire[1].startswith("Modbus")
        heading = f"line {wire[0]}  " if modbus else f"{wire[0]}  "
        console.print(
            Text.assemble((heading, "bold cyan"), f"{wire[1]} at {wire[2]}"), soft_wrap=True
        )
        table = Table.grid(padding=(0, 2, 0, 0))
        table.add_column(width=9)
        table.add_column(width=16)
        table.add_column()
        for device in group:
            kind = "node" if wire[0] == "CAN" else "unit"
            number = f"  {kind} {device.number}" if device.number else ""
            table.add_row(number, Text(device.name, "bold"), Text(device.description))
        console.print(table, "")
    console.print("ready; Ctrl-C ends the emulation", style="bold green")
    sys.stdout.flush()
