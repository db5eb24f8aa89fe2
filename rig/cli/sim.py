"""`rig sim RIG`."""

import itertools
import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer
from rich.table import Table
from rich.text import Text

from rig.cli.input_files import CAMPAIGNS, RIGS, SESSIONS, input_file
from rig.cli.options import WIRED_RIG_HELP
from rig.cli.output import FAILED, OK, fail, input_errors
from rig.cli.stop_signals import stop_signals
from rig.config.rig_file import BaseRigFile
from rig.config.segment import Segment
from rig.config.shipped_files import PLANTS
from rig.config.wiring import (
    CanBus,
    RtuLine,
    SerialPort,
    TcpLine,
    UdpDevice,
    Wire,
    Wiring,
    WiringError,
)
from rig.config.yaml_source import load_mapping
from rig.emulation.addresses import occupied_addresses, unreachable_addresses
from rig.kinds.registry import find
from rig.kinds.rig_file import load_rig
from rig.presentation.console import table_console
from rig.processes.io_processes import IoProcess, IoProcessError, IoProcesses

EXIT_CODES = """\
Exit codes: 0 ended by Ctrl-C; 1 an address is in use, or the devices failed; 2 bad input."""
_POLL_INTERVAL_S = 0.05
_STOP_TIMEOUT_S = 5.0


def command(
    path: Annotated[Path, typer.Argument(metavar="RIG", help=WIRED_RIG_HELP)],
    campaign: Annotated[
        Path | None,
        typer.Option("--campaign", help="Campaign that defines the sea (default: calm water)."),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one line of JSON when ready.")
    ] = False,
) -> int:
    """Emulate the devices of a wired rig, at the addresses of its rig file, until Ctrl-C."""
    with input_errors("sim", as_json=as_json):
        rig, devices, sea = _open_devices(path, campaign)
        wiring = _checked_wiring(rig)
    # The devices check again, but only after their start.
    if taken_addresses := occupied_addresses(wiring):
        busy = RuntimeError("\n".join(taken_addresses))
        return fail("sim", busy, as_json=as_json, code=FAILED)
    with (
        stop_signals() as stop_requested,
        tempfile.TemporaryDirectory(prefix="rig-sim-") as folder,
    ):
        io_processes = IoProcesses((devices,), Path(folder))
        try:
            if not as_json:
                print("starting the emulated devices ...", file=sys.stderr, flush=True)
            io_processes.start()
        except IoProcessError as error:
            io_processes.end(_STOP_TIMEOUT_S)
            if stop_requested():
                return OK
            message = str(error).removeprefix(f"{devices.name}: ")
            return fail("sim", RuntimeError(message), as_json=as_json, code=FAILED)
        try:
            show(rig.name, emulated_devices(wiring), sea, as_json=as_json)
            trouble = _wait_for_end(io_processes, stop_requested)
        finally:
            io_processes.end(_STOP_TIMEOUT_S)
    if trouble:
        print(f"rig sim: {trouble}", file=sys.stderr)
        return FAILED
    if not as_json:
        print("\nended; all addresses are free again", file=sys.stderr)
    return OK


def _open_devices(path: Path, campaign: Path | None) -> tuple[BaseRigFile, IoProcess, str]:
    """Return the rig, the process that emulates its devices, and their setting in words."""
    path = input_file(path, RIGS)
    rig, locate, kind = load_rig(path)
    emulation = kind.room("rehearsal.emulation")
    if campaign is not None:
        found: tuple[BaseRigFile, IoProcess, str] = emulation.emulate_task(
            input_file(campaign, CAMPAIGNS, SESSIONS), path
        )
        return found
    plant, locate_plant = load_mapping(
        locate.existing_path(("plant",), rig.plant, PLANTS), locate(("plant",)), "plant"
    )
    return rig, *emulation.emulate_rig(rig, plant, locate_plant)


def _checked_wiring(rig: BaseRigFile) -> Wiring:
    """Return the wiring of a rig whose devices can be emulated; WiringError gives the reason."""
    if rig.wiring is None:
        raise WiringError(f"{rig.name} has no wiring, so no devices can be emulated")
    if reasons := unreachable_addresses(rig.wiring):
        raise WiringError("\n".join(reasons))
    find(rig.kind).room("hardware.job").build_job(rig)
    return rig.wiring


def _wait_for_end(io_processes: IoProcesses, stop_requested: Callable[[], bool]) -> str:
    """Wait for Ctrl-C; return the trouble that ended the devices before it (empty: none)."""
    while not stop_requested():
        trouble = io_processes.check()
        for line in io_processes.messages:
            print(line, file=sys.stderr, flush=True)
        io_processes.messages.clear()
        if trouble:
            return trouble
        time.sleep(_POLL_INTERVAL_S)
    return ""


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
            node = drive.can_node.node
            yield EmulatedDevice(name, protocol, address, node, drive_name, drive.description)
    elif isinstance(part, Segment):
        for place, slave in enumerate(part.line, 1):
            yield EmulatedDevice(name, name, address, place, slave.name, slave.device.title)
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
        where = f"on {wire[2]}" if wire[0] == wire[1] else f"{wire[1]} at {wire[2]}"
        console.print(Text.assemble((heading, "bold cyan"), where), soft_wrap=True)
        table = Table.grid(padding=(0, 2, 0, 0))
        table.add_column(min_width=9, no_wrap=True)
        table.add_column(width=16)
        table.add_column()
        for device in group:
            kind = {"CAN": "node", "EtherCAT": "slave"}.get(wire[0], "unit")
            number = f"  {kind} {device.number}" if device.number else ""
            table.add_row(number, Text(device.name, "bold"), Text(device.description))
        console.print(table, "")
    console.print("ready; Ctrl-C ends the emulation", style="bold green")
    sys.stdout.flush()
