"""`rig scan can|ethercat|modbus`."""

from collections.abc import Iterator
from contextlib import contextmanager
from enum import StrEnum
from typing import Annotated, Any

import typer
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table
from rich.text import Text

from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.service import NodeIdentity
from drivers.modbus.line import RtuSettings, TcpSettings
from rig.cli.options import Json
from rig.cli.output import FAILED, OK, STOPPED, fail, input_errors, print_json
from rig.presentation.console import plain_table, table_console
from rig.processes.wire_locks import (
    Wire,
    acquire,
    can_wire,
    network_wire,
    segment_wire,
    serial_wire,
)
from rig.recording.runs.create import BusyError
from rig.wires import scan
from rig.wires.segment_survey import find_slaves

_EXIT_CODES = """\
Exit codes: 0 a device answers; 1 no device answers, the wire cannot be opened, or it is in use; \
2 bad input; 3 stopped by the operator."""
_LATE_ANSWER_S = 0.1  # wait for a late answer after a timeout on a serial line


command = typer.Typer(no_args_is_help=True)


class Parity(StrEnum):
    """Parity of a serial line."""

    NONE = "N"
    EVEN = "E"
    ODD = "O"


@command.command(epilog=_EXIT_CODES)
def can(
    interface: Annotated[
        str, typer.Option("--interface", "-i", help="python-can's name: socketcan, pcan, ...")
    ],
    channel: Annotated[str, typer.Option("--channel", "-c", help="As python-can names it: can0.")],
    bit_rate: Annotated[
        int, typer.Option("--bit-rate", min=10_000, max=1_000_000, help="bit/s.")
    ] = 1_000_000,
    option: Annotated[
        list[str] | None,
        typer.Option("--option", "-o", metavar="NAME=VALUE", help="For python-can; repeatable."),
    ] = None,
    timeout: Annotated[
        float, typer.Option("--timeout", min=0.05, max=60, help="Timeout of the answers, s.")
    ] = 0.5,
    listen: Annotated[
        bool, typer.Option("--listen", help="Send nothing; works while a run uses the bus.")
    ] = False,
    as_json: Json = False,
) -> int:
    """List the CANopen nodes 1 to 127 that answer, with their identities."""
    with input_errors("scan can", as_json=as_json):
        bus = BusSettings(interface, channel, bit_rate, tuple(map(_parse_option, option or [])))
    try:
        if listen:
            return _listen_can(bus, timeout, as_json=as_json)
        with acquire((can_wire(bus),), "rig scan can"):
            nodes = scan.scan_nodes(bus, timeout)
    except BusyError as error:
        refusal = RuntimeError(
            f"{error}; --listen sends nothing and lists the nodes that send by themselves"
        )
        return fail("scan can", refusal, as_json=as_json, code=FAILED)
    except (OSError, ValueError) as error:
        return fail("scan can", error, as_json=as_json, code=FAILED)
    if as_json:
        node_data = [{"node": node, **identity._asdict()} for node, identity in nodes.items()]
        print_json({"status": "complete", "nodes": node_data})
    elif nodes:
        table_console().print(_node_table(nodes))
    else:
        print(f"no node answers on {interface} {channel} within {timeout:g} s")
    return OK if nodes else FAILED


@command.command(epilog=_EXIT_CODES)
def ethercat(
    interface: Annotated[str, typer.Argument(metavar="IFACE", help="Network interface: eth1.")],
    as_json: Json = False,
) -> int:
    """List the EtherCAT slaves in the order of the line, with their identities.

    They are brought to PRE-OP for it, and left in INIT: not while another master runs them.
    """
    try:
        with acquire((segment_wire(interface),), "rig scan ethercat"):
            found = find_slaves(interface)
    except (BusyError, OSError) as error:
        return fail("scan ethercat", error, as_json=as_json, code=FAILED)
    if as_json:
        slaves = [{"place": at, **each._asdict()} for at, each in enumerate(found, 1)]
        print_json({"status": "complete", "slaves": slaves})
        return OK
    table = plain_table(">slave", "vendor", "product", "revision", "name…")
    for at, each in enumerate(found, 1):
        numbers = map(_hex_text, (each.vendor, each.product, each.revision))
        table.add_row(str(at), *numbers, Text(each.name or "-"))
    table_console().print(table)
    return OK


@command.command(epilog=_EXIT_CODES)
def modbus(
    address: Annotated[
        str | None, typer.Argument(metavar="[HOST:PORT]", help="Modbus/TCP server or gateway.")
    ] = None,
    serial: Annotated[
        str | None,
        typer.Option("--serial", help="Serial port of an RTU line, instead of HOST:PORT."),
    ] = None,
    baud: Annotated[
        int, typer.Option("--baud", min=1200, max=4_000_000, help="Rate of the serial line, bit/s.")
    ] = 19_200,
    parity: Annotated[
        Parity, typer.Option("--parity", help="Parity of the serial line.")
    ] = Parity.NONE,
    stop_bits: Annotated[
        int, typer.Option("--stop-bits", min=1, max=2, help="Stop bits of the serial line.")
    ] = 1,
    first: Annotated[int, typer.Option("--first", min=1, max=247, help="First unit number.")] = 1,
    last: Annotated[int, typer.Option("--last", min=1, max=247, help="Last unit number.")] = 247,
    timeout: Annotated[
        float, typer.Option("--timeout", min=0.01, max=10, help="Timeout of each answer, s.")
    ] = 0.3,
    register: Annotated[
        int, typer.Option("--register", min=0, max=65_535, help="Holding register to read.")
    ] = 0,
    as_json: Json = False,
) -> int:
    """List the Modbus units that answer, with a value or an exception, on TCP or a serial line."""
    with input_errors("scan modbus", as_json=as_json):
        if (address is None) == (serial is None):
            raise ValueError("give either HOST:PORT or --serial PORT")
        settings: RtuSettings | TcpSettings
        if serial is not None:
            settings = RtuSettings(serial, baud, parity.value, stop_bits, timeout, _LATE_ANSWER_S)
        else:
            settings = _tcp_settings(address or "", timeout)
        if first > last:
            raise ValueError(f"--first {first} is above --last {last}")
    numbers = range(first, last + 1)
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
        return fail("scan modbus", error, as_json=as_json, code=FAILED)
    answering = [unit for unit in results if unit.answers]
    all_answer = len(answering) == len(numbers) > 1
    if as_json:
        units = [
            {"unit": unit.unit, "answered_in_s": unit.duration, "answer": unit.answer}
            for unit in answering
        ]
        print_json(
            {
                "status": "stopped" if stopped else "complete",
                "queried": [unit.unit for unit in results],
                "every_number_answers": all_answer,
                "units": units,
            }
        )
    else:
        _print_units(answering, len(results), len(numbers), all_answer=all_answer)
    if stopped:
        return STOPPED
    return OK if answering else FAILED


def _listen_can(bus: BusSettings, timeout: float, *, as_json: bool) -> int:
    numbers = scan.listen_for_nodes(bus, timeout)
    if as_json:
        print_json({"status": "complete", "listened_only": True, "heard": list(numbers)})
    elif numbers:
        print(f"sending by themselves: node {', '.join(map(str, numbers))}")
    else:
        print(f"no node sends on {bus.interface} {bus.channel} within {timeout:g} s")
    return OK if numbers else FAILED


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


def _tcp_settings(address: str, timeout: float) -> TcpSettings:
    host, _, port = address.rpartition(":")
    if not host:
        host, port = address, "502"
    if not port.isdigit() or not 0 < int(port) < 1 << 16:
        raise ValueError(f"{address!r} is not HOST:PORT")
    return TcpSettings(host, int(port), timeout)


def _node_table(nodes: dict[int, NodeIdentity]) -> Table:
    identity_columns = ("device type", "vendor", "product", "revision", "serial", "errors")
    table = plain_table(">node", *identity_columns, "name…")
    for node, identity in nodes.items():
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
    table = plain_table(">unit", ">answered in", "with…")
    for unit in answering:
        table.add_row(str(unit.unit), f"{1e3 * unit.duration:.1f} ms", Text(unit.answer))
    console.print(table)
    console.print(f"\n{len(answering)} of {queried} units answer{stopped_text}")
    if all_answer:
        console.print("every unit number answers: one device probably ignores the number")
