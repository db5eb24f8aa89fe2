"""Locks on wires: one for each CAN bus, serial port and network endpoint, one for real time.

A program that sends on a wire holds its lock, so that two programs of one host never command one
device. A lock is a Unix domain socket with an abstract name (unix(7)). The kernel lets only one
socket have a name. No file, permission or environment variable is involved, so all users of the
host share the lock. The name is free again when the last process that inherited the descriptor has
closed it: a loop that outlives its killed supervisor keeps its wires.

Abstract names belong to a network namespace: two containers with namespaces of their own do not
see each other's locks.
"""

import errno
import itertools
import os
import socket
import stat
from collections.abc import Iterable
from contextlib import ExitStack, suppress
from hashlib import sha256
from ipaddress import ip_address
from pathlib import Path
from typing import NamedTuple

from drivers.canopen.bus_settings import BusSettings
from rig import module_process
from rig.config import wiring
from rig.config.rig_file import BaseRigFile
from rig.config.segment import Segment
from rig.recording.runs.create import BusyError
from rig.user_names import peer, user_name

_PREFIX = "wec-rig/"
_MAX_NAME_BYTES = 100  # bytes of a name; the kernel takes 107
_BACKLOG = 1 << 16  # queued connections of refused programs; the kernel reduces it to its limit
_label_numbers = itertools.count()


class Wire(NamedTuple):
    """One wire: its name and address for people, its identities for the locks."""

    name: str  # in the rig file: CAN, line io, servo, ...
    address: str
    identities: frozenset[str]  # two wires are one if they share an identity


REALTIME_WIRE = Wire("the real-time loop of this host", "", frozenset({"realtime"}))
"""The lock of the host's only loop on the real clock: two would disturb each other's ticks."""


class WireLocks:
    """Locks on several wires, held until `close`, and by every process that inherits `fds`."""

    def __init__(self, sockets: Iterable[socket.socket]) -> None:
        self._sockets = tuple(sockets)

    @property
    def fds(self) -> tuple[int, ...]:
        """The file descriptors to pass on to processes that use the wires."""
        return tuple(lock.fileno() for lock in self._sockets)

    def close(self) -> None:
        """Release all locks that no other process holds."""
        for lock in self._sockets:
            lock.close()

    def __enter__(self) -> "WireLocks":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def acquire(wires: Iterable[Wire], holder: str) -> WireLocks:
    """Acquire the locks of all these wires, or of none; BusyError names every one that is taken.

    ``holder``: the campaign or command that takes them, as other programs will report it.
    """
    requested = tuple(wires)
    identities = sorted({identity for wire in requested for identity in wire.identities})
    with ExitStack() as taken:
        sockets, refused = list[socket.socket](), set[str]()
        for identity in identities:
            if (lock := _bind_lock(identity)) is None:
                refused.add(identity)
            else:
                sockets.append(taken.enter_context(lock))
        if refused:
            conflicts = [
                _conflict_text(wire, refused) for wire in requested if wire.identities & refused
            ]
            raise BusyError("\n".join(conflicts))
        sockets.append(_bind_label(holder))
        taken.pop_all()
    return WireLocks(sockets)


def wires_in(rig: BaseRigFile) -> tuple[Wire, ...]:
    """Return every wire of a rig file; none if it has no wiring."""
    return () if rig.wiring is None else tuple(map(lockable, rig.wiring.wires()))


def lockable(wire: wiring.Wire) -> Wire:
    """Return a wire of a rig's wiring with its identities."""
    part = wire.part
    if isinstance(part, wiring.CanBus):
        return can_wire(part.settings())
    if isinstance(part, Segment):
        return segment_wire(part.interface)
    if isinstance(part, wiring.TcpLine | wiring.UdpDevice):
        return network_wire(wire.name, wire.kind, part.host, part.port)
    return serial_wire(wire.name, part.port)


def can_wire(bus: BusSettings) -> Wire:
    """Return the wire of a CAN bus.

    A bus behind a serial port (slcan) has the identity of that port. A bus behind a socketcand of
    this host also has the identity of the kernel's interface of that name, where there is one.
    """
    interface, channel = bus.interface, bus.channel
    name, address = "CAN", f"{interface} {channel}"
    if "/" in channel:
        port = channel.partition("@")[0]  # slcan takes PORT@BAUD
        return Wire(name, address, serial_wire(name, port).identities)
    if interface == "socketcan":
        return Wire(name, address, frozenset({f"can/socketcan/{_kernel_interface_name(channel)}"}))
    if interface == "socketcand":
        host, port_number = bus.endpoint
        ends = _endpoint_identities("socketcand", host, port_number)
        identities = {f"can/{end}/{channel}" for end in ends}
        if any("/127." in end or "/::1:" in end for end in ends) and _is_kernel_interface(channel):
            identities.add(f"can/socketcan/{_kernel_interface_name(channel)}")
        return Wire(name, f"{address} at {host}:{port_number}", frozenset(identities))
    return Wire(name, address, frozenset({f"can/{interface}/{channel}"}))


def segment_wire(interface: str) -> Wire:
    """Return the wire of an EtherCAT segment: its network interface."""
    identity = f"ethercat/{_kernel_interface_name(interface)}"
    return Wire("EtherCAT", interface, frozenset({identity}))


def serial_wire(name: str, port: str) -> Wire:
    """Return the wire of a serial port: its path, and its device number if the port exists.

    Links in /dev/serial/by-id and the device they lead to have one number. An emulated port is a
    link that exists only while its devices are emulated, so the path counts as well.
    """
    path = Path(port)
    identities = {f"serial{Path(os.path.realpath(path.parent)) / path.name}"}
    with suppress(OSError):
        status = path.stat()
        if stat.S_ISCHR(status.st_mode):
            identities.add(f"serial/{os.major(status.st_rdev)}:{os.minor(status.st_rdev)}")
    return Wire(name, port, frozenset(identities))


def network_wire(name: str, kind: str, host: str, port: int) -> Wire:
    """Return the wire of a TCP or UDP endpoint (``kind``: tcp, udp): all addresses of its host."""
    return Wire(name, f"{host}:{port}", frozenset(_endpoint_identities(kind, host, port)))


def _endpoint_identities(kind: str, host: str, port: object) -> set[str]:
    try:
        addresses = {str(info[4][0]) for info in socket.getaddrinfo(host, None)}
    except (OSError, UnicodeError):  # no such name: nobody can reach it under any name
        return {f"{kind}/{host.lower()}:{port}"}
    return {f"{kind}/{_normalised_address(address)}:{port}" for address in addresses}


def _normalised_address(address: str) -> str:
    """Return an address in its shortest form: IPv4 in IPv6 as IPv4, the unspecified as loopback."""
    try:
        parsed = ip_address(address)
    except ValueError:
        return address
    mapped = getattr(parsed, "ipv4_mapped", None) or parsed
    if mapped.is_unspecified:
        return "127.0.0.1" if mapped.version == 4 else "::1"
    return str(mapped)


def _kernel_interface_name(channel: str) -> str:
    """Return the kernel's own name of a network interface, which may have alternative names."""
    try:
        return socket.if_indextoname(socket.if_nametoindex(channel))
    except OSError:
        return channel


def _is_kernel_interface(channel: str) -> bool:
    try:
        return socket.if_nametoindex(channel) > 0
    except OSError:
        return False


def _socket_name(identity: str) -> str:
    name = _PREFIX + identity
    if len(name.encode()) > _MAX_NAME_BYTES:
        name = f"{name[:38]}.../{sha256(identity.encode()).hexdigest()[:32]}"
    return f"\0{name}"


def _bind_lock(identity: str) -> socket.socket | None:
    """Return the socket of a lock; None if another program has it."""
    lock = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        lock.bind(_socket_name(identity))
        lock.listen(_BACKLOG)
    except OSError as error:
        lock.close()
        if error.errno != errno.EADDRINUSE:
            raise
        return None
    return lock


def _bind_label(holder: str) -> socket.socket:
    """Bind a socket whose name in /proc/net/unix shows all users what this process does."""
    pid = os.getpid()
    text = "".join(character if character.isprintable() else "?" for character in holder)
    name = f"{_PREFIX}holder/{pid}/{module_process.start_ticks(pid)}/{next(_label_numbers)}/{text}"
    label = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    label.bind(b"\0" + name.encode()[:_MAX_NAME_BYTES])
    return label


def _conflict_text(wire: Wire, refused: set[str]) -> str:
    identity = min(wire.identities & refused)
    holder = _holder_text(identity)
    return f"{wire.name}{wire.address and ' '}{wire.address} is taken by {holder}"


def _holder_text(identity: str) -> str:
    """Return who holds a lock and what to do about it, also if the holder was killed."""
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
            client.setblocking(False)
            client.connect(_socket_name(identity))
            pid, uid = peer(client)
    except OSError:  # the lock was just released, or the kernel's queue of connections is full
        return "another program; try again"
    label, began = _read_label(pid)
    holder = f"{label} (process {pid}, user {user_name(uid)})"
    if module_process.start_ticks(pid) is None or module_process.start_ticks(pid) != began:
        return (
            f"{holder}, which was killed; its loop is coming to a stop: try again in some seconds"
        )
    return f"{holder}; wait for its end, or stop it with Ctrl-C"


def _read_label(pid: int) -> tuple[str, int | None]:
    """Return the label that a process set when it took its locks, and the process's start time."""
    prefix = f"@{_PREFIX}holder/{pid}/"
    for line in Path("/proc/net/unix").read_text(errors="replace").splitlines():
        _, found, name = line.partition(prefix)
        if found:
            began, _, label = name.split("/", 2)
            return label, int(began) if began.isdigit() else None
    return "a program", module_process.start_ticks(pid)
