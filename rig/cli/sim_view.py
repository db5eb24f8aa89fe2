"""The emulated devices of a rig and their addresses, for people and programs."""

import itertools
import json
import sys
from collections.abc import Iterator
from typing import Any, NamedTuple

from rich.table import Table
from rich.text import Text

from rig.config.wiring import CanBus, RtuLine, SerialPort, TcpLine, UdpDevice, Wire, Wiring
from rig.presentation.console import table_console


class EmulatedDevice(NamedTuple):
    """An emulated device on a wire."""

    wire: str  # CAN, or the name of the line
    protocol: str  # protocol
    address: str
    number: int  # of the node or unit
    name: str
    description: str


def emulated_devices(wiring: Wiring) -> list[EmulatedDevice]:
    """Return every emulated device with its address."""
    return [device for wire in wiring.wires() for device in _devices_on(wire, wiring)]


def _devices_on(wire: Wire, wiring: Wiring) -> Iterator[EmulatedDevice]:
    name, address, part = wire.name, wire.address, wire.part
    if isinstance(part, CanBus):
        protocol, address = f"socketcand {part.channel}", "{}:{}".format(*part.settings().endpoint)
        for drive_name, drive in wiring.drives().items():
            yield EmulatedDevice(name, protocol, address, drive.node, drive_name, drive.description)
    elif isinstance(part, SerialPort | UdpDevice):
        protocol = part.protocol if isinstance(part, UdpDevice) else f"serial, {_mode(part)}"
        number = getattr(part, "address", None) or 0
        device = name.replace(" ", "_")
        yield EmulatedDevice(name, protocol, address, number, device, part.description)
    else:
        protocol = "Modbus TCP" if isinstance(part, TcpLine) else f"Modbus RTU, {_mode(part)}"
        line = name.removeprefix("line ")
        for block_name, block in wiring.blocks().items():
            if block.line == line:
                device = wiring.block_content(block_name).device
                yield EmulatedDevice(line, protocol, address, block.unit, block_name, device)


def _mode(port: SerialPort | RtuLine) -> str:
    return f"{port.baud} baud 8{port.parity}{port.stop_bits},"


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
