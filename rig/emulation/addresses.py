"""Checks whether emulated devices can use a rig's addresses: on this host, and free."""

import errno
import os
import socket
import stat
from contextlib import suppress
from pathlib import Path

from rig.config.segment import Segment
from rig.config.wiring import CanBus, RtuLine, SerialPort, TcpLine, UdpDevice, WirePart, Wiring
from rig.emulation.cable import cable_holder, cable_problem
from rig.wires.wire_check import is_loopback

_FIRST_PTS_MAJOR = 136  # first major number of pseudo-terminals
_EMULATION_MODULE = ".rehearsal.emulation"  # ends the name of the module of emulated devices


def unreachable_addresses(wiring: Wiring) -> tuple[str, ...]:
    """Return why wires cannot lead to emulated devices, each wire by its name; empty if all can."""
    problems = ((wire.name, _unreachable(wire.part)) for wire in wiring.wires())
    return tuple(f"{name}: {why}" for name, why in problems if why)


def occupied_addresses(wiring: Wiring) -> tuple[str, ...]:
    """Return which addresses are occupied, each wire by its name; empty if all are free."""
    problems = ((wire.name, _occupied(wire.part)) for wire in wiring.wires())
    return tuple(f"{name}: {why}" for name, why in problems if why)


def _endpoint(part: WirePart) -> tuple[str, int] | None:
    """Return host and port of a wire on the network."""
    if isinstance(part, CanBus):
        return part.settings().endpoint if part.interface == "socketcand" else None
    return (part.host, part.port) if isinstance(part, TcpLine | UdpDevice) else None


def _unreachable(part: WirePart) -> str:
    if endpoint := _endpoint(part):
        host, _ = endpoint
        return "" if is_loopback(host) else f"{host} is not this host's loopback"
    if isinstance(part, Segment):
        return cable_problem(part.interface)
    if isinstance(part, CanBus):
        return (
            f"emulated nodes are reached over socketcand only, not {part.interface} {part.channel}"
        )
    if isinstance(part, SerialPort | RtuLine):
        in_dev = Path("/dev") in Path(os.path.abspath(part.port)).parents
        return f"{part.port} is in /dev, where no emulated port can be created" if in_dev else ""
    return ""


def _occupied(part: WirePart) -> str:
    if endpoint := _endpoint(part):
        kind = socket.SOCK_DGRAM if isinstance(part, UdpDevice) else socket.SOCK_STREAM
        why = _socket_problem(*endpoint, kind)
        return why and "{}:{} {}".format(*endpoint, why)
    if isinstance(part, Segment):
        why = cable_holder(part.interface)
        return why and f"{part.interface} {why}"
    if isinstance(part, SerialPort | RtuLine):
        why = _terminal_problem(Path(part.port))
        return why and f"{part.port} {why}"
    return ""


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
