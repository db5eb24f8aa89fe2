"""`rig scan can|modbus`."""

import sys
from enum import StrEnum
from typing import Annotated

import typer

_EXIT_CODES = """\
Exit codes: 0 a device answers; 1 no device answers, the wire cannot be opened, or it is in use; \
2 bad input; 3 stopped by the operator."""

app = typer.Typer(
    name="scan",
    no_args_is_help=True,
    help="List the devices on a wire without a rig file. It only reads.",
)

Json = Annotated[bool, typer.Option("--json", help="Print JSON instead of text.")]


class Parity(StrEnum):
    """Parity of a serial line."""

    NONE = "N"
    EVEN = "E"
    ODD = "O"


@app.command(epilog=_EXIT_CODES)
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
        float, typer.Option("--patience", min=0.05, max=60, help="Timeout of the answers, s.")
    ] = 0.5,
    listen: Annotated[
        bool, typer.Option("--listen", help="Send nothing; works while a run uses the bus.")
    ] = False,
    json: Json = False,
) -> None:
    """List the CANopen nodes 1 to 127 that answer, with their identities."""
    from rig.cli.scan_commands import scan_can

    bus_options = (interface, channel, bit_rate, option or [])
    sys.exit(scan_can(*bus_options, timeout=timeout, only_listen=listen, as_json=json))


@app.command(epilog=_EXIT_CODES)
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
    json: Json = False,
) -> None:
    """List the Modbus units that answer, with a value or an exception, on TCP or a serial line."""
    from rig.cli.scan_commands import SerialLine, scan_modbus

    line = None if serial is None else SerialLine(serial, baud, parity.value, stop_bits)
    scan_options = (address, line, (first, last), timeout, register)
    sys.exit(scan_modbus(*scan_options, as_json=json))
