"""What `rig scan can` and `rig scan modbus` do."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from drivers.canopen.bus_settings import Bus
from drivers.modbus.line import Rtu, Tcp
from rig import cli
from rig.cli.command_error import fail
from rig.cli.console import table_console
from rig.execution.hardware import scan
from rig.processes.wire_locks import Wire, can_wire, hold, network_wire, serial_wire
from rig.recording.runs.create import BusyError

_QUIET = 0.1  # s after a missed answer on a serial line, for a late one


class Serial(NamedTuple):
    """A serial line."""

    port: str
    baud: int
    parity: str
    stop_bits: int


def scan_can(
    interface: str,
    channel: str,
    bit_rate: int,
    options: list[str],
    *,
    patience: float,
    only_listen: bool,
    as_json: bool,
) -> int:
    """Print the nodes that answer, or that send by themselves; gives the exit code."""
    try:
        bus = Bus(interface, channel, bit_rate, tuple(map(_option, options)))
    except ValueError as error:
        return fail("scan can", error, as_json=as_json)
    try:
        if only_listen:
            return _listened(bus, patience, as_json=as_json)
        with hold((can_wire(interface, channel, dict(bus.options)),), "rig scan can"):
            found = scan.nodes(bus, patience)
    except BusyError as error:
        told = RuntimeError(f"{error}; --listen hears who sends by himself, and sends nothing")
        return fail("scan can", told, as_json=as_json, code=cli.FAILED)
    except (OSError, ValueError) as error:
        return fail("scan can", error, as_json=as_json, code=cli.FAILED)
    if as_json:
        nodes = [{"node": one.node, **one.identity._asdict()} for one in found]
        print(json.dumps({"status": "complete", "nodes": nodes}))
    elif found:
        table_console().print(_nodes(found))
    else:
        print(f"no node answers on {interface} {channel} within {patience:g} s")
    return cli.OK if found else cli.FAILED


def scan_modbus(
    address: str | None,
    line: Serial | None,
    span: tuple[int, int],
    timeout: float,
    register: int,
    *,
    as_json: bool,
) -> int:
    """Print the units that answer; gives the exit code."""
    try:
        settings = _line(address, line, timeout)
        if span[0] > span[1]:
            raise ValueError(f"--first {span[0]} is above --last {span[1]}")
    except ValueError as error:
        return fail("scan modbus", error, as_json=as_json)
    numbers = range(span[0], span[1] + 1)
    asked: list[scan.UnitAsked] = []
    stopped = False
    try:
        with (
            hold((_wire(settings),), "rig scan modbus"),
            _progress(len(numbers), quiet=as_json) as step,
        ):
            try:
                for one in scan.units(settings, numbers, register):
                    asked.append(one)
                    step(one)
            except KeyboardInterrupt:
                stopped = True
    except (BusyError, OSError) as error:
        return fail("scan modbus", error, as_json=as_json, code=cli.FAILED)
    found = [one for one in asked if one.answers]
    everybody = len(found) == len(numbers) > 1
    if as_json:
        print(
            json.dumps(
                {
                    "status": "stopped" if stopped else "complete",
                    "asked": [one.unit for one in asked],
                    "every_number_answers": everybody,
                    "units": [
                        {"unit": one.unit, "answered_in_s": one.took, "said": one.said}
                        for one in found
                    ],
                }
            )
        )
    else:
        _tell(found, len(asked), len(numbers), everybody=everybody)
    if stopped:
        return cli.STOPPED
    return cli.OK if found else cli.FAILED


def _listened(bus: Bus, patience: float, *, as_json: bool) -> int:
    numbers = scan.heard(bus, patience)
    if as_json:
        print(json.dumps({"status": "complete", "listened_only": True, "heard": list(numbers)}))
    elif numbers:
        print(f"heard without asking: node {', '.join(map(str, numbers))}")
    else:
        print(f"no node sends on {bus.interface} {bus.channel} within {patience:g} s")
    return cli.OK if numbers else cli.FAILED


def _wire(settings: Tcp | Rtu) -> Wire:
    if isinstance(settings, Rtu):
        return serial_wire("serial line", settings.port)
    return network_wire("Modbus/TCP server", "tcp", settings.host, settings.port)


def _option(text: str) -> tuple[str, Any]:
    """A python-can option: a whole number, true, false, or else text."""
    name, given, value = text.partition("=")
    if not given or not name:
        raise ValueError(f"--option {text!r} is not NAME=VALUE")
    if value.lower() in ("true", "false"):
        return name, value.lower() == "true"
    try:
        return name, int(value, 0)
    except ValueError:
        return name, value


def _line(address: str | None, line: Serial | None, timeout: float) -> Tcp | Rtu:
    if (address is None) == (line is None):
        raise ValueError("give either HOST:PORT or --serial PORT")
    if line is not None:
        return Rtu(*line, timeout, _QUIET)
    host, _, port = (address or "").rpartition(":")
    if not host:
        host, port = address or "", "502"
    if not port.isdigit() or not 0 < int(port) < 1 << 16:
        raise ValueError(f"{address!r} is not HOST:PORT")
    return Tcp(host, int(port), timeout)


def _nodes(found: tuple[scan.NodeHeard, ...]) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column("node", justify="right", no_wrap=True)
    for name in ("device type", "vendor", "product", "revision", "serial"):
        table.add_column(name, no_wrap=True)
    table.add_column("errors", no_wrap=True)
    table.add_column("name", overflow="fold")
    for node, who in found:
        table.add_row(
            str(node),
            *(
                _hexadecimal(value)
                for value in (who.device_type, who.vendor, who.product, who.revision, who.serial)
            ),
            "-" if who.error_register is None else f"{who.error_register:#04x}",
            Text(who.name or "-"),
        )
    return table


def _hexadecimal(value: int | None) -> str:
    return "-" if value is None else f"{value:#010x}"


@contextmanager
def _progress(count: int, *, quiet: bool) -> Iterator[Any]:
    """A bar with the time left, on a terminal only; what answers is told as it is found."""
    console = table_console()
    if quiet or not console.is_terminal:
        yield lambda one: None
        return
    columns = (
        TextColumn("unit {task.fields[unit]}"), BarColumn(), MofNCompleteColumn(),
        TextColumn("time left"), TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=count, unit="")

        def step(one: scan.UnitAsked) -> None:
            if one.answers:
                bar.console.print(f"unit {one.unit} answers")
            bar.update(task, advance=1, unit=one.unit)

        yield step


def _tell(found: list[scan.UnitAsked], asked: int, wanted: int, *, everybody: bool) -> None:
    console = table_console()
    cut = f" (stopped; {wanted - asked} not asked)" if asked < wanted else ""
    if not found:
        console.print(f"none of {asked} units answers{cut}")
        return
    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column("unit", justify="right", no_wrap=True)
    table.add_column("answered in", justify="right", no_wrap=True)
    table.add_column("with")
    for one in found:
        table.add_row(str(one.unit), f"{1e3 * one.took:.1f} ms", Text(one.said))
    console.print(table)
    console.print(f"\n{len(found)} of {asked} units answer{cut}")
    if everybody:
        console.print("every number answers: it is one device that does not look at them")
