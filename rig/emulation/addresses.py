"""Checks whether emulated devices can use a rig's addresses: on this host, and free."""

import errno
import os
import socket
import stat
from collections.abc import Iterator
from contextlib import suppress
from ipaddress import ip_address
from pathlib import Path
from typing import NamedTuple

from drivers.canopen.bus_settings import SOCKETCAND_PORT
from rig.config.wiring import CanBus, TcpLine, Wiring
from rig.kinds.oswec_bench.config.wiring import BenchWiring

_FIRST_PTS_MAJOR = 136  # first major number of pseudo-terminals
_EMULATOR_MODULES = (
    "rig.kinds.wavebot.rehearsal.emulation",
    "rig.kinds.oswec_bench.rehearsal.emulation",
)

AnyWiring = Wiring | BenchWiring


class _WireAddresses(NamedTuple):
    """The addresses of all wires of a rig, by name."""

    tcp: dict[str, tuple[str, int]]
    udp: dict[str, tuple[str, int]]
    serial: dict[str, str]


def unreachable_addresses(wiring: AnyWiring) -> tuple[str, ...]:
    """Return why wires cannot lead to emulated devices, each wire by its name; empty if all can."""
    return tuple(_find_unreachable(wiring))


def occupied_addresses(wiring: AnyWiring) -> tuple[str, ...]:
    """Return which addresses are occupied, each wire by its name; empty if all are free."""
    addresses = _wire_addresses(wiring)
    return tuple(_find_occupied(addresses))


def can_address(bus: CanBus) -> tuple[str, int]:
    """Return host and port of a bus that is reached over TCP."""
    host, port = bus.options.get("host", "127.0.0.1"), bus.options.get("port", SOCKETCAND_PORT)
    return str(host), int(port)


def _wire_addresses(wiring: AnyWiring) -> _WireAddresses:
    addresses = _WireAddresses({}, {}, {})
    if isinstance(wiring, BenchWiring):
        addresses.serial.update(encoders=wiring.encoders.port, servo=wiring.servo.port)
        addresses.udp["load cell"] = wiring.load_cell.host, wiring.load_cell.port
    else:
        addresses.tcp["CAN"] = can_address(wiring.can)
    for name, line in wiring.lines.items():
        if isinstance(line, TcpLine):
            addresses.tcp[f"line {name}"] = line.host, line.port
        else:
            addresses.serial[f"line {name}"] = line.port
    return addresses


def _find_unreachable(wiring: AnyWiring) -> Iterator[str]:
    addresses = _wire_addresses(wiring)
    if isinstance(wiring, Wiring) and wiring.can.interface != "socketcand":
        del addresses.tcp["CAN"]
        yield (
            f"CAN: emulated nodes are reached over socketcand only, not {wiring.can.interface} "
            f"{wiring.can.channel}"
        )
    for name, (host, _) in {**addresses.tcp, **addresses.udp}.items():
        if not _is_loopback(host):
            yield f"{name}: {host} is not this host's loopback"
    for name, port in addresses.serial.items():
        if Path("/dev") in Path(os.path.abspath(port)).parents:
            yield f"{name}: {port} is in /dev, where no emulated port can be created"


def _find_occupied(addresses: _WireAddresses) -> Iterator[str]:
    for ports, kind in ((addresses.tcp, socket.SOCK_STREAM), (addresses.udp, socket.SOCK_DGRAM)):
        for name, (host, port) in ports.items():
            if why := _socket_problem(host, port, kind):
                yield f"{name}: {host}:{port} {why}"
    for name, path in addresses.serial.items():
        if why := _terminal_problem(Path(path)):
            yield f"{name}: {path} {why}"


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    with suppress(ValueError):
        return ip_address(host).is_loopback
    return False


def _socket_problem(host: str, port: int, kind: socket.SocketKind) -> str:
    with socket.socket(type=kind) as probe:
        if kind is socket.SOCK_STREAM:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                return "is taken by another program (`ss -ltnp` names it)"
            return f"cannot be used: {error.strerror or error}"
    return ""


def _terminal_problem(path: Path) -> str:
    """Return why a path for a pseudo-terminal is not free; empty for a stale link."""
    if not path.is_symlink():
        return "exists and is no link to a pseudo-terminal" if path.exists() else ""
    try:
        status = path.stat()
    except OSError:
        return ""
    if not (stat.S_ISCHR(status.st_mode) and os.major(status.st_rdev) >= _FIRST_PTS_MAJOR):
        return f"leads to {path.resolve()}, which is no pseudo-terminal"
    holder = _master_process(os.minor(status.st_rdev))
    if holder is not None and not any(
        module in _command_line(holder) for module in _EMULATOR_MODULES
    ):
        return ""  # a stale link of a killed process; another program has the terminal now
    owner = f"process {holder}" if holder else "another user's process"
    return f"is taken by emulated devices of {owner}"


def _master_process(index: int) -> int | None:
    """Return the process that has a pseudo-terminal's master open; None if it is not visible."""
    index_line = f"tty-index:\t{index}\n"
    for info in Path("/proc").glob("[0-9]*/fdinfo/*"):
        with suppress(OSError):
            if index_line in info.read_text():
                return int(info.parts[2])
    return None


def _command_line(process: int) -> str:
    try:
        return Path(f"/proc/{process}/cmdline").read_text()
    except OSError:
        return ""
