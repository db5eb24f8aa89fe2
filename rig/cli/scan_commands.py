"""Implementation of `rig scan can` and `rig scan modbus`."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from drivers.canopen.bus_settings import BusSettings
from drivers.modbus.line import RtuSettings, TcpSettings
from rig import cli
from rig.cli.command_error import fail
from rig.cli.console import table_console
from rig.recording.runs.create import BusyError
from rig.wires import scan
from rig.wires.locks import Wire, acquire, can_wire, network_wire, serial_wire

_LATE_ANSWER_S = 0.1  # wait for a late answer after a timeout on a serial line


class SerialLine(NamedTuple):
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
    timeout: float,
    only_listen: bool,
    as_json: bool,
) -> int:
    """Print the nodes that answer, or that send by themselves, and return the exit code."""
    try:
        bus = BusSettings(interface, channel, bit_rate, tuple(map(_parse_option, options)))
    except ValueError as error:
        return fail("scan can", error, as_json=as_json)
    try:
        if only_listen:
            return _listen_can(bus, timeout, as_json=as_json)
        with acquire((can_wire(bus),), "rig scan can"):
            nodes = scan.scan_nodes(bus, timeout)
    except BusyError as error:
        refusal = RuntimeError(
            f"{error}; --listen sends nothing and lists the nodes that send by themselves"
        )
        return fail("scan can", refusal, as_json=as_json, code=cli.FAILED)
    except (OSError, ValueError) as error:
        return fail("scan can", error, as_json=as_json, code=cli.FAILED)
    if as_json:
        node_data = [{"node": node.node, **node.identity._asdict()} for node in nodes]
        print(json.dumps({"status": "complete", "nodes": node_data}))
    elif nodes:
        table_console().print(_node_table(nodes))
    else:
        print(f"no node answers on {interface} {channel} within {timeout:g} s")
    return cli.OK if nodes else cli.FAILED


def scan_modbus(
    address: str | None,
    line: SerialLine | None,
    unit_range: tuple[int, int],
    timeout: float,
    register: int,
    *,
    as_json: bool,
) -> int:
    """Print the units that answer, and return the exit code."""
    try:
        settings = _line_settings(address, line, timeout)
        if unit_range[0] > unit_range[1]:
            raise ValueError(f"--first {unit_range[0]} is above --last {unit_range[1]}")
    except ValueError as error:
        return fail("scan modbus", error, as_json=as_json)
    numbers = range(unit_range[0], unit_range[1] + 1)
    results: list[scan.UnitResponse] = []
    stopped = False
    try:
        with (
            acquire((_wire_of(settings),), "rig scan modbus"),
            _progress_bar(len(numbers), quiet=as_json) as step,
        ):
            try:
                for result in scan.scan_units(settings, numbers, register):
                    results.append(result)
                    step(result)
            except KeyboardInterrupt:
                stopped = True
    except (BusyError, OSError) as error:
        return fail("scan modbus", error, as_json=as_json, code=cli.FAILED)
    answering = [unit for unit in results if unit.answers]
    all_answer = len(answering) == len(numbers) > 1
    if as_json:
        print(
            json.dumps(
                {
                    "status": "stopped" if stopped else "complete",
                    "queried": [unit.unit for unit in results],
                    "every_number_answers": all_answer,
                    "units": [
                        {"unit": unit.unit, "answered_in_s": unit.duration, "answer": unit.answer}
                        for unit in answering
                    ],
                }
            )
        )
    else:
        _print_units(answering, len(results), len(numbers), all_answer=all_answer)
    if stopped:
        return cli.STOPPED
    return cli.OK if answering else cli.FAILED


def _listen_can(bus: BusSettings, timeout: float, *, as_json: bool) -> int:
    numbers = scan.listen_for_nodes(bus, timeout)
    if as_json:
        print(json.dumps({"status": "complete", "listened_only": True, "heard": list(numbers)}))
    elif numbers:
        print(f"sending by themselves: node {', '.join(map(str, numbers))}")
    else:
        print(f"no node sends on {bus.interface} {bus.channel} within {timeout:g} s")
    return cli.OK if numbers else cli.FAILED


def _wire_of(settings: TcpSettings | RtuSettings) -> Wire:
    if isinstance(settings, RtuSettings):
        return serial_wire("serial line", settings.port)
    return network_wire("Modbus/TCP server", "tcp", settings.host, settings.port)


def _parse_option(text: str) -> tuple[str, Any]:
    """Parse an option of python-can: NAME=VALUE with an integer, true, false, or a text."""
    name, given, value = text.partition("=")
    if not given or not name:
        raise ValueError(f"--option {text!r} is not NAME=VALUE")
    if value.lower() in ("true", "false"):
        return name, value.lower() == "true"
    try:
        return name, int(value, 0)
    except ValueError:
        return name, value


def _line_settings(
    address: str | None, line: SerialLine | None, timeout: float
) -> TcpSettings | RtuSettings:
    if (address is None) == (line is None):
        raise ValueError("give either HOST:PORT or --serial PORT")
    if line is not None:
        return RtuSettings(*line, timeout, _LATE_ANSWER_S)
    host, _, port = (address or "").rpartition(":")
    if not host:
        host, port = address or "", "502"
    if not port.isdigit() or not 0 < int(port) < 1 << 16:
        raise ValueError(f"{address!r} is not HOST:PORT")
    return TcpSettings(host, int(port), timeout)


def _node_table(nodes: tuple[scan.DetectedNode, ...]) -> Table:
    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column("node", justify="right", no_wrap=True)
    for name in ("device type", "vendor", "product", "revision", "serial"):
        table.add_column(name, no_wrap=True)
    table.add_column("errors", no_wrap=True)
    table.add_column("name", overflow="fold")
    for node, identity in nodes:
        table.add_row(
            str(node),
            *map(_hex_text, identity[:5]),  # device type to serial number
            "-" if identity.error_register is None else f"{identity.error_register:#04x}",
            Text(identity.name or "-"),
        )
    return table


def _hex_text(value: int | None) -> str:
    return "-" if value is None else f"{value:#010x}"


@contextmanager
def _progress_bar(count: int, *, quiet: bool) -> Iterator[Any]:
    """Show a bar with the remaining time, on a terminal only; print each unit that answers."""
    console = table_console()
    if quiet or not console.is_terminal:
        yield lambda unit: None
        return
    columns = (
        TextColumn("unit {task.fields[unit]}"), BarColumn(), MofNCompleteColumn(),
        TextColumn("time left"), TimeRemainingColumn(),
    )  # fmt: skip
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=count, unit="")

        def step(unit: scan.UnitResponse) -> None:
            if unit.answers:
                bar.console.print(f"unit {unit.unit} answers")
            bar.update(task, advance=1, unit=unit.unit)

        yield step


def _print_units(
    answering: list[scan.UnitResponse], queried: int, total: int, *, all_answer: bool
) -> None:
    console = table_console()
    stopped_text = f" (stopped; {total - queried} not queried)" if queried < total else ""
    if not answering:
        console.print(f"none of {queried} units answers{stopped_text}")
        return
    table = Table(box=None, header_style="bold", pad_edge=False)
    table.add_column("unit", justify="right", no_wrap=True)
    table.add_column("answered in", justify="right", no_wrap=True)
    table.add_column("with")
    for unit in answering:
        table.add_row(str(unit.unit), f"{1e3 * unit.duration:.1f} ms", Text(unit.answer))
    console.print(table)
    console.print(f"\n{len(answering)} of {queried} units answer{stopped_text}")
    if all_answer:
        console.print("every unit number answers: one device probably ignores the number")
