"""Checks whether emulated devices can use a rig's addresses: on this host, and free."""

import errno
import os
import socket
import stat
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from rig.config.wiring import CanBus, TcpLine, UdpDevice, Wiring
from rig.wires.wire_check import is_loopback

_FIRST_PTS_MAJOR = 136  # first major number of pseudo-terminals
_EMULATION_MODULE = ".rehearsal.emulation"  # ends the name of the module of emulated devices


class _WireAddresses(NamedTuple):
    """The addresses of all wires of a rig, by name."""

    tcp: dict[str, tuple[str, int]]
    udp: dict[str, tuple[str, int]]
    serial: dict[str, str]


def unreachable_addresses(wiring: Wiring) -> tuple[str, ...]:
    """Return why wires cannot lead to emulated devices, each wire by its name; empty if all can."""
    return tuple(_find_unreachable(wiring))


def occupied_addresses(wiring: Wiring) -> tuple[str, ...]:
    """Return which addresses are occupied, each wire by its name; empty if all are free."""
    return tuple(_find_occupied(_wire_addresses(wiring)))


def _wire_addresses(wiring: Wiring) -> _WireAddresses:
    addresses = _WireAddresses({}, {}, {})
    for name, _, part in wiring.wires():
        if isinstance(part, CanBus):
            if part.interface == "socketcand":
                addresses.tcp[name] = part.settings().endpoint
        elif isinstance(part, TcpLine):
            addresses.tcp[name] = part.host, part.port
        elif isinstance(part, UdpDevice):
            addresses.udp[name] = part.host, part.port
        else:
            addresses.serial[name] = part.port
    return addresses


def _find_unreachable(wiring: Wiring) -> Iterator[str]:
    for name, _, part in wiring.wires():
        if isinstance(part, CanBus) and part.interface != "socketcand":
            yield (
                f"{name}: emulated nodes are reached over socketcand only, not {part.interface} "
                f"{part.channel}"
            )
    addresses = _wire_addresses(wiring)
    for name, (host, _) in {**addresses.tcp, **addresses.udp}.items():
        if not is_loopback(host):
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
    if holder is not None and _EMULATION_MODULE not in _command_line(holder):
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
