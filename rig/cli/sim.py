"""`rig sim RIG`."""

import itertools
import json
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

from rich.table import Table
from rich.text import Text

from rig import cli
from rig.cli.console import table_console
from rig.cli.failure import fail
from rig.cli.refusal import REFUSED, refuse
from rig.companions import Companion, CompanionError, Companions
from rig.config.rig_file import RigFile
from rig.config.wiring import WORDS, Registers, TcpLine, Wiring
from rig.hardware.job import WiringError, job_of
from rig.rehearsal.addresses import can_address, impossible, taken
from rig.rehearsal.alone import in_calm_water

_LOOK = 0.05  # s
_PATIENCE = 5.0  # s for the devices to leave
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
}


class _There(NamedTuple):
    """One device on a wire."""

    wire: str  # CAN, or the line's name
    how: str  # protocol
    address: str
    number: int  # of the node or unit
    name: str
    what: str


def main(path: Path, campaign: Path | None, *, as_json: bool) -> int:
    """Be the devices of a rig until Ctrl-C; gives the exit code."""
    try:
        rig, devices, sea = _devices(path, campaign)
        wiring = _wiring(rig)
    except REFUSED as error:
        return refuse("sim", error, as_json=as_json)
    if held := taken(wiring):  # the devices look again; here it is known in no time
        busy = RuntimeError("\n".join(held))
        return fail("sim", busy, as_json=as_json, code=cli.FAILED)
    with _interrupts() as asked, tempfile.TemporaryDirectory(prefix="rig-sim-") as folder:
        companions = Companions((devices,), Path(folder))
        try:
            if not as_json:
                print("starting the emulated devices ...", file=sys.stderr, flush=True)
            companions.start()
        except CompanionError as error:
            companions.end(_PATIENCE)
            if asked():
                return cli.OK
            why = str(error).removeprefix(f"{devices.name}: ")
            return fail("sim", RuntimeError(why), as_json=as_json, code=cli.FAILED)
        try:
            _show(rig, _hanging(wiring), sea, as_json=as_json)
            trouble = _stay(companions, asked)
        finally:
            companions.end(_PATIENCE)
    if trouble:
        print(f"rig sim: {trouble}", file=sys.stderr)
        return cli.FAILED
    if not as_json:
        print("\nended; all addresses are free", file=sys.stderr)
    return cli.OK


def _devices(path: Path, campaign: Path | None) -> tuple[RigFile, Companion, str]:
    """The rig, who plays its devices, and the sea they are in."""
    if campaign is None:
        rig, devices = in_calm_water(path)
        return rig, devices, "calm water"
    from rig.campaign.files import open_campaign  # scipy: seconds
    from rig.rehearsal import emulation, job

    opened = open_campaign(campaign, job.problems, path)
    sea = f"{opened.file.sea.words()}, once the rig's wave trigger is on"
    return opened.rig, emulation.companion(opened), sea


def _wiring(rig: RigFile) -> Wiring:
    """The wires of a rig whose devices can be emulated; WiringError says why not."""
    if rig.wiring is None:
        raise WiringError(f"{rig.name} has no wiring to hang emulated devices on")
    why = impossible(rig.wiring)
    if why:
        raise WiringError("\n".join(why))
    job_of(rig)
    return rig.wiring


def _hanging(wiring: Wiring) -> list[_There]:
    """Every emulated device and where it is."""
    can = wiring.can
    bus = "{}:{}".format(*can_address(can))
    found = [
        _There("CAN", f"socketcand {can.channel}", bus, one.node, name, what)
        for name, one, what in (
            ("heave", wiring.heave, _PLAYED[wiring.heave.scaling]),
            ("surge", wiring.surge, _PLAYED[wiring.surge.scaling]),
            ("stator", wiring.stator, "actuator: profile position, homing"),
        )
    ]
    for line_name, line in wiring.lines.items():
        if isinstance(line, TcpLine):
            how, address = "Modbus TCP", f"{line.host}:{line.port}"
        else:
            how = f"Modbus RTU, {line.baud} baud 8{line.parity}{line.stop_bits},"
            address = line.port
        for name in WORDS:
            block: Registers = getattr(wiring, name)
            if block.line == line_name:
                found.append(_There(line_name, how, address, block.unit, name, _UNITS[name]))
    return found


def _show(rig: RigFile, hanging: list[_There], sea: str, *, as_json: bool) -> None:
    if as_json:
        told: dict[str, Any] = {
            "status": "ready",
            "rig": rig.name,
            "sea": sea,
            "devices": [one._asdict() for one in hanging],
        }
        print(json.dumps(told, ensure_ascii=False), flush=True)
        return
    console = table_console()
    console.print(Text.assemble("\n", (rig.name, "bold"), f": emulated devices in {sea}\n"))
    for wire, several in itertools.groupby(hanging, lambda one: (one.wire, one.how, one.address)):
        head = f"{wire[0]}  " if wire[0] == "CAN" else f"line {wire[0]}  "
        console.print(Text.assemble((head, "bold cyan"), f"{wire[1]} at {wire[2]}"), soft_wrap=True)
        table = Table.grid(padding=(0, 2, 0, 0))
        table.add_column(width=9)
        table.add_column(width=16)
        table.add_column()
        for one in several:
            kind = "node" if one.wire == "CAN" else "unit"
            table.add_row(f"  {kind} {one.number}", Text(one.name, "bold"), Text(one.what))
        console.print(table, "")
    console.print("ready; Ctrl-C ends", style="bold green")
    sys.stdout.flush()


def _stay(companions: Companions, asked: Callable[[], bool]) -> str:
    """Wait for Ctrl-C; why it ended without one, empty otherwise."""
    while not asked():
        trouble = companions.listen()
        for line in companions.said:
            print(line, file=sys.stderr, flush=True)
        companions.said.clear()
        if trouble:
            return trouble
        time.sleep(_LOOK)
    return ""


@contextmanager
def _interrupts() -> Iterator[Callable[[], bool]]:
    """Ctrl-C, termination and a closed terminal are one request: to end."""
    count = 0

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal count
        count += 1

    numbers = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
    before = {number: signal.signal(number, interrupt) for number in numbers}
    try:
        yield lambda: count > 0
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
