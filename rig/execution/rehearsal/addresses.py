"""Whether emulated devices can be where a rig's wires lead: on this host, and not taken."""

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
from rig.config.bench_wiring import BenchWiring
from rig.config.wiring import CanBus, TcpLine, Wiring

_PTS = 136  # first major number of pseudo-terminals
_PROCESSES = ("rig.execution.rehearsal.emulation", "rig.execution.rehearsal.bench_emulation")

AnyWiring = Wiring | BenchWiring


class _Ends(NamedTuple):
    """Where all wires of a rig lead, each by its name."""

    tcp: dict[str, tuple[str, int]]
    udp: dict[str, tuple[str, int]]
    serial: dict[str, str]


def impossible(wiring: AnyWiring) -> tuple[str, ...]:
    """Why these wires lead to no emulated device, each wire by its name; empty if all can."""
    return tuple(_impossible(wiring))


def taken(wiring: AnyWiring) -> tuple[str, ...]:
    """Which addresses somebody has already, each by its name; empty if all are free."""
    ends = _ends(wiring)
    return tuple(_taken(ends))


def can_address(bus: CanBus) -> tuple[str, int]:
    """Host and port of a bus that is reached over TCP."""
    host, port = bus.options.get("host", "127.0.0.1"), bus.options.get("port", SOCKETCAND_PORT)
    return str(host), int(port)


def _ends(wiring: AnyWiring) -> _Ends:
    ends = _Ends({}, {}, {})
    if isinstance(wiring, BenchWiring):
        ends.serial.update(encoders=wiring.encoders.port, servo=wiring.servo.port)
        ends.udp["load cell"] = wiring.load_cell.host, wiring.load_cell.port
    else:
        ends.tcp["CAN"] = can_address(wiring.can)
    for name, line in wiring.lines.items():
        if isinstance(line, TcpLine):
            ends.tcp[f"line {name}"] = line.host, line.port
        else:
            ends.serial[f"line {name}"] = line.port
    return ends


def _impossible(wiring: AnyWiring) -> Iterator[str]:
    ends = _ends(wiring)
    if isinstance(wiring, Wiring) and wiring.can.interface != "socketcand":
        del ends.tcp["CAN"]
        yield (
            f"CAN: emulated nodes are reached over socketcand only, not {wiring.can.interface} "
            f"{wiring.can.channel}"
        )
    for name, (host, _) in {**ends.tcp, **ends.udp}.items():
        if not _here(host):
            yield f"{name}: {host} is not this host's loopback"
    for name, port in ends.serial.items():
        if Path("/dev") in Path(os.path.abspath(port)).parents:
            yield f"{name}: {port} is a place for devices that are there, not emulated"


def _taken(ends: _Ends) -> Iterator[str]:
    for ports, kind in ((ends.tcp, socket.SOCK_STREAM), (ends.udp, socket.SOCK_DGRAM)):
        for name, (host, port) in ports.items():
            if why := _listening(host, port, kind):
                yield f"{name}: {host}:{port} {why}"
    for name, path in ends.serial.items():
        if why := _held(Path(path)):
            yield f"{name}: {path} {why}"


def _here(host: str) -> bool:
    if host == "localhost":
        return True
    with suppress(ValueError):
        return ip_address(host).is_loopback
    return False


def _listening(host: str, port: int, kind: socket.SocketKind) -> str:
    with socket.socket(type=kind) as probe:
        if kind is socket.SOCK_STREAM:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((host, port))
        except OSError as error:
            if error.errno == errno.EADDRINUSE:
                return "is taken by another program (`ss -ltnp` names it)"
            return f"cannot be had: {error.strerror or error}"
    return ""


def _held(path: Path) -> str:
    """Why a path for a pseudo-terminal is not free; a link that was left behind is."""
    if not path.is_symlink():
        return "is there, and no link to a pseudo-terminal" if path.exists() else ""
    try:
        seen = path.stat()
    except OSError:
        return ""
    if not (stat.S_ISCHR(seen.st_mode) and os.major(seen.st_rdev) >= _PTS):
        return f"leads to {path.resolve()}, which is no pseudo-terminal"
    holder = _master(os.minor(seen.st_rdev))
    if holder is not None and not any(one in _words(holder) for one in _PROCESSES):
        return ""  # left behind by who was killed; since then the terminal is another's
    who = f"process {holder}" if holder else "another user's process"
    return f"is taken by emulated devices of {who}"


def _master(index: int) -> int | None:
    """The process that has the master of a pseudo-terminal open; None if that cannot be seen."""
    wanted = f"tty-index:\t{index}\n"
    for info in Path("/proc").glob("[0-9]*/fdinfo/*"):
        with suppress(OSError):
            if wanted in info.read_text():
                return int(info.parts[2])
    return None


def _words(process: int) -> str:
    try:
        return Path(f"/proc/{process}/cmdline").read_text()
    except OSError:
        return ""
