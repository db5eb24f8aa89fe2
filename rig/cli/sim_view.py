"""Every emulated device of a rig and where it is, for people and programs."""

import itertools
import json
import sys
from collections.abc import Iterable
from typing import Any, NamedTuple

from rich.table import Table
from rich.text import Text

from rig.cli.console import table_console
from rig.config.bench_wiring import BENCH_SLOT_SIGNALS, BenchWiring, SerialPort
from rig.config.wiring import SLOT_SIGNALS, AnyLine, Registers, TcpLine, Wiring
from rig.execution.rehearsal.addresses import AnyWiring, can_address

_PLAYED = {
    "amc": "torque drive, AMC scaling",
    "rated_torque": "torque drive, scaled by its rated torque",
    "rated_current": "torque drive, scaled by its rated current",
}
_UNITS = {
    "analyser": "power analyser",
    "cells": "strain-gauge amplifier: load cells",
    "probes": "strain-gauge amplifier: wave probes",
    "inputs": "I/O coupler: digital inputs",
    "outputs": "I/O coupler: digital outputs",
    "analog": "I/O coupler: analog outputs for servo and brake",
    "brake": "measuring amplifier: current of the brake",
}


class There(NamedTuple):
    """One device on a wire."""

    wire: str  # CAN, or the line's name
    how: str  # protocol
    address: str
    number: int  # of the node or unit
    name: str
    what: str


def hanging(wiring: AnyWiring) -> list[There]:
    """Every emulated device and where it is."""
    if isinstance(wiring, BenchWiring):
        return [*_streams(wiring), *_units(wiring, wiring.lines, BENCH_SLOT_SIGNALS)]
    return [*_nodes(wiring), *_units(wiring, wiring.lines, SLOT_SIGNALS)]


def _nodes(wiring: Wiring) -> list[There]:
    can = wiring.can
    bus = "{}:{}".format(*can_address(can))
    return [
        There("CAN", f"socketcand {can.channel}", bus, one.node, name, what)
        for name, one, what in (
            ("heave", wiring.heave, _PLAYED[wiring.heave.scaling]),
            ("surge", wiring.surge, _PLAYED[wiring.surge.scaling]),
            ("stator", wiring.stator, "actuator: profile position, homing"),
        )
    ]


def _streams(wiring: BenchWiring) -> list[There]:
    encoders, servo, cell = wiring.encoders, wiring.servo, wiring.load_cell
    address = servo.address or 0
    return [
        There("encoders", _serial(encoders), encoders.port, 0, "encoders", "encoder bridge"),
        There("servo", _serial(servo), servo.port, address, "servo", "servo drive, Compax3"),
        There(
            "load cell", "RDT over UDP", f"{cell.host}:{cell.port}", 0, "load_cell", "ATI Net F/T"
        ),
    ]


def _serial(port: SerialPort) -> str:
    return f"serial, {port.baud} baud 8{port.parity}{port.stop_bits},"


def _units(wiring: AnyWiring, lines: dict[str, AnyLine], words: Iterable[str]) -> list[There]:
    found = []
    for line_name, line in lines.items():
        if isinstance(line, TcpLine):
            how, address = "Modbus TCP", f"{line.host}:{line.port}"
        else:
            how = f"Modbus RTU, {line.baud} baud 8{line.parity}{line.stop_bits},"
            address = line.port
        for name in words:
            block: Registers = getattr(wiring, name)
            if block.line == line_name:
                found.append(There(line_name, how, address, block.unit, name, _UNITS[name]))
    return found


def show(rig: str, there: list[There], setting: str, *, as_json: bool) -> None:
    """Say what is there: one line of JSON, or a table a wire."""
    if as_json:
        told: dict[str, Any] = {
            "status": "ready",
            "rig": rig,
            "sea": setting,
            "devices": [one._asdict() for one in there],
        }
        print(json.dumps(told, ensure_ascii=False), flush=True)
        return
    console = table_console()
    console.print(Text.assemble("\n", (rig, "bold"), f": emulated devices in {setting}\n"))
    for wire, several in itertools.groupby(there, lambda one: (one.wire, one.how, one.address)):
        modbus = wire[1].startswith("Modbus")
        head = f"line {wire[0]}  " if modbus else f"{wire[0]}  "
        console.print(Text.assemble((head, "bold cyan"), f"{wire[1]} at {wire[2]}"), soft_wrap=True)
        table = Table.grid(padding=(0, 2, 0, 0))
        table.add_column(width=9)
        table.add_column(width=16)
        table.add_column()
        for one in several:
            kind = "node" if wire[0] == "CAN" else "unit"
            number = f"  {kind} {one.number}" if one.number else ""
            table.add_row(number, Text(one.name, "bold"), Text(one.what))
        console.print(table, "")
    console.print("ready; Ctrl-C ends", style="bold green")
    sys.stdout.flush()
