"""Locks on wires: one for every CAN bus, serial port and network endpoint, one for real time.

Whoever sends on a wire holds its lock, so that two programs of one host never command one device.
A lock is a Unix domain socket with an abstract name (unix(7)). The kernel lets one socket have a
name; no file, permission or environment variable is involved, so every user of the host meets the
same lock; and the name is free again when the last process that inherited the descriptor has
closed it. A loop that outlives its killed supervisor therefore keeps its wires.

Abstract names belong to a network namespace: two containers with namespaces of their own do not
see each other's locks.
"""

import errno
import itertools
import os
import pwd
import socket
import stat
import struct
from collections.abc import Iterable, Mapping
from contextlib import ExitStack, suppress
from hashlib import sha256
from ipaddress import ip_address
from pathlib import Path
from typing import Any, NamedTuple

from drivers.canopen.bus_settings import SOCKETCAND_PORT
from rig.config.any_rig_file import AnyRigFile
from rig.config.bench_wiring import BenchWiring
from rig.config.wiring import AnyLine, TcpLine
from rig.recording import process_identity
from rig.recording.runs.create import BusyError

_PREFIX = "wec-rig/"
_LONGEST = 100  # bytes of a name; the kernel takes 107
_LOOKS = 1 << 16  # connections of refused programs that may queue; the kernel cuts it to its limit
_CREDENTIALS = struct.Struct("3i")  # pid, uid, gid
_numbers = itertools.count()


class Wire(NamedTuple):
    """One wire, as people know it and as the lock does."""

    name: str  # in the rig file: CAN, line io, servo, ...
    address: str
    identities: frozenset[str]  # two wires are one if they share an identity


REALTIME_PLACE = Wire("the real-time loop of this host", "", frozenset({"realtime"}))
"""The host's one place for a loop on the real clock: two would disturb each other's ticks."""


class WireLocks:
    """Locks on several wires, held until `close` and by every process that inherits `fds`."""

    def __init__(self, sockets: Iterable[socket.socket]) -> None:
        self._sockets = tuple(sockets)

    @property
    def fds(self) -> tuple[int, ...]:
        """File descriptors, to be passed on to processes that use the wires."""
        return tuple(one.fileno() for one in self._sockets)

    def close(self) -> None:
        """Let all go, as far as no other process holds them."""
        for one in self._sockets:
            one.close()

    def __enter__(self) -> "WireLocks":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def hold(wires: Iterable[Wire], holder: str) -> WireLocks:
    """Take the locks of all these wires, or of none; BusyError names every one that is taken.

    ``holder``: the campaign or command that takes them, for whoever is refused meanwhile.
    """
    wanted = tuple(wires)
    identities = sorted({identity for one in wanted for identity in one.identities})
    with ExitStack() as taken:
        sockets, refused = list[socket.socket](), set[str]()
        for identity in identities:
            if (lock := _bound(identity)) is None:
                refused.add(identity)
            else:
                sockets.append(taken.enter_context(lock))
        if refused:
            told = [_refusal(one, refused) for one in wanted if one.identities & refused]
            raise BusyError("\n".join(told))
        sockets.append(_label(holder))
        taken.pop_all()
    return WireLocks(sockets)


def wires_of(rig: AnyRigFile) -> tuple[Wire, ...]:
    """Every wire of a rig file; none if it has no wiring."""
    wiring = rig.wiring
    if wiring is None:
        return ()
    if isinstance(wiring, BenchWiring):
        cell = wiring.load_cell
        found = [
            serial_wire("encoders", wiring.encoders.port),
            serial_wire("servo", wiring.servo.port),
            network_wire("load cell", "udp", cell.host, cell.port),
        ]
    else:
        can = wiring.can
        found = [can_wire(can.interface, can.channel, can.options)]
    return (*found, *(_line(f"line {name}", line) for name, line in wiring.lines.items()))


def can_wire(interface: str, channel: str, options: Mapping[str, Any]) -> Wire:
    """A CAN bus by python-can's interface, channel and options.

    A bus behind a serial port (slcan) is that port. A bus behind a socketcand of this host is also
    the kernel's interface of that name, where there is one.
    """
    name, address = "CAN", f"{interface} {channel}"
    if "/" in channel:
        port = channel.partition("@")[0]  # slcan takes PORT@BAUD
        return Wire(name, address, serial_wire(name, port).identities)
    if interface == "socketcan":
        return Wire(name, address, frozenset({f"can/socketcan/{_interface(channel)}"}))
    if interface == "socketcand":
        host, port = str(options.get("host", "127.0.0.1")), options.get("port", SOCKETCAND_PORT)
        ends = _endpoints("socketcand", host, port)
        found = {f"can/{one}/{channel}" for one in ends}
        if any("/127." in one or "/::1:" in one for one in ends) and _kernel_has(channel):
            found.add(f"can/socketcan/{_interface(channel)}")
        return Wire(name, f"{address} at {host}:{port}", frozenset(found))
    return Wire(name, address, frozenset({f"can/{interface}/{channel}"}))


def serial_wire(name: str, port: str) -> Wire:
    """A serial port by its path, and by its device number where it is there.

    Links in /dev/serial/by-id and the device they lead to have one number. An emulated port is a
    link that is not there before its devices are, so the path counts as well.
    """
    path = Path(port)
    found = {f"serial{Path(os.path.realpath(path.parent)) / path.name}"}
    with suppress(OSError):
        seen = path.stat()
        if stat.S_ISCHR(seen.st_mode):
            found.add(f"serial/{os.major(seen.st_rdev)}:{os.minor(seen.st_rdev)}")
    return Wire(name, port, frozenset(found))


def network_wire(name: str, kind: str, host: str, port: int) -> Wire:
    """A TCP or UDP endpoint (``kind``: tcp, udp) by all addresses that its host has."""
    return Wire(name, f"{host}:{port}", frozenset(_endpoints(kind, host, port)))


def _line(name: str, line: AnyLine) -> Wire:
    if isinstance(line, TcpLine):
        return network_wire(name, "tcp", line.host, line.port)
    return serial_wire(name, line.port)


def _endpoints(kind: str, host: str, port: object) -> set[str]:
    try:
        found = {str(one[4][0]) for one in socket.getaddrinfo(host, None)}
    except (OSError, UnicodeError):  # no such name: nobody reaches it, under this name or another
        return {f"{kind}/{host.lower()}:{port}"}
    return {f"{kind}/{_plain(one)}:{port}" for one in found}


def _plain(address: str) -> str:
    """An address in its shortest form; IPv4 in IPv6 is IPv4, and none at all is this host."""
    try:
        found = ip_address(address)
    except ValueError:
        return address
    mapped = getattr(found, "ipv4_mapped", None) or found
    if mapped.is_unspecified:
        return "127.0.0.1" if mapped.version == 4 else "::1"
    return str(mapped)


def _interface(channel: str) -> str:
    """The kernel's own name of a network interface, which may have others."""
    try:
        return socket.if_indextoname(socket.if_nametoindex(channel))
    except OSError:
        return channel


def _kernel_has(channel: str) -> bool:
    try:
        return socket.if_nametoindex(channel) > 0
    except OSError:
        return False


def _abstract(identity: str) -> str:
    name = _PREFIX + identity
    if len(name.encode()) > _LONGEST:
        name = f"{name[:38]}.../{sha256(identity.encode()).hexdigest()[:32]}"
    return f"\0{name}"


def _bound(identity: str) -> socket.socket | None:
    """The socket of a lock; None if another has it."""
    lock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        lock.bind(_abstract(identity))
        lock.listen(_LOOKS)
    except OSError as error:
        lock.close()
        if error.errno != errno.EADDRINUSE:
            raise
        return None
    return lock


def _label(holder: str) -> socket.socket:
    """A socket whose name tells everybody, in /proc/net/unix, what this process does."""
    pid = os.getpid()
    text = "".join(letter if letter.isprintable() else "?" for letter in holder)
    name = f"{_PREFIX}holder/{pid}/{process_identity.start_ticks(pid)}/{next(_numbers)}/{text}"
    label = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    label.bind(b"\0" + name.encode()[:_LONGEST])
    return label


def _refusal(wire: Wire, refused: set[str]) -> str:
    identity = min(wire.identities & refused)
    who = _holder(identity)
    return f"{wire.name}{wire.address and ' '}{wire.address} is taken by {who}"


def _holder(identity: str) -> str:
    """Who has a lock, and what to do about it; also if its own process is gone."""
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
            asking.setblocking(False)
            asking.connect(_abstract(identity))
            size = _CREDENTIALS.size
            told = asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, size)
    except OSError:  # it has just let go, or so many were refused that the kernel queues no more
        return "another program; try again"
    pid, uid, _ = _CREDENTIALS.unpack(told)
    what, began = _labelled(pid)
    who = f"{what} (process {pid}, user {_user(uid)})"
    if process_identity.start_ticks(pid) is None or process_identity.start_ticks(pid) != began:
        return f"{who}, which was killed; its loop is coming to a stop: try again in some seconds"
    return f"{who}; wait for its end, or stop it with Ctrl-C"


def _labelled(pid: int) -> tuple[str, int | None]:
    """What a process said it does when it took its locks, and when it had begun."""
    mark = f"@{_PREFIX}holder/{pid}/"
    for line in Path("/proc/net/unix").read_text(errors="replace").splitlines():
        _, found, label = line.partition(mark)
        if found:
            began, _, what = label.split("/", 2)
            return what, int(began) if began.isdigit() else None
    return "a program", process_identity.start_ticks(pid)


def _user(uid: int) -> str:
    with suppress(KeyError):
        return pwd.getpwuid(uid).pw_name
    return str(uid)
