"""What the tests need of a kernel with SocketCAN: interfaces up and down, a bridge to a hub."""

from __future__ import annotations

import contextlib
import fcntl
import os
import pty
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import pytest

from drivers.canopen.bus_settings import BusSettings
from sim_plant.emulators.can_frame import Frame
from sim_plant.emulators.can_hub import CanHub

NAME = os.environ.get("SOCKETCAN_TESTS", "")
needs_kernel = pytest.mark.skipif(
    not NAME, reason="needs a virtual CAN interface of its own: make test-socketcan"
)
BUS = BusSettings("socketcan", NAME, 1_000_000, ())
FRAME = struct.Struct("=IB3x8s")
ERROR, REMOTE, EXTENDED = 0x2000_0000, 0x4000_0000, 0x8000_0000  # bits of the kernel's identifier
BUS_OFF = 0x40
_FLAGS, _SET_FLAGS, _UP = 0x8913, 0x8914, 0x1
_NAME_OF, _SET_DISCIPLINE, _SLCAN = 0x8910, 0x5423, 17


def switch(name: str, up: bool) -> None:
    """Take an interface up or down."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as any_socket:
        found = fcntl.ioctl(any_socket, _FLAGS, struct.pack("=16sh14x", name.encode(), 0))
        (flags,) = struct.unpack_from("=h", found, 16)
        flags = flags | _UP if up else flags & ~_UP
        fcntl.ioctl(any_socket, _SET_FLAGS, struct.pack("=16sh14x", name.encode(), flags))


class RawSocket:
    """A station of its own, without any library."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.socket.bind((NAME,))
        self.socket.setblocking(False)

    def send(self, identifier: int, data: bytes = b"", length: int | None = None) -> None:
        size = len(data) if length is None else length
        self.socket.send(FRAME.pack(identifier, size, data.ljust(8, b"\0")))

    def heard(self) -> Iterator[tuple[int, bytes]]:
        """Frames that have come."""
        with contextlib.suppress(BlockingIOError):
            while True:
                identifier, size, data = FRAME.unpack(self.socket.recv(FRAME.size))
                yield identifier, data[:size]


@contextmanager
def raw_socket() -> Iterator[RawSocket]:
    station = RawSocket()
    try:
        yield station
    finally:
        station.socket.close()


class Slow(NamedTuple):
    """An interface over a serial line of which nobody reads the far end."""

    name: str
    hang_up: Callable[[], None]


@contextmanager
def slow_interface() -> Iterator[Slow]:
    """A kernel's slcan interface on a pseudo-terminal; up."""
    far, near = pty.openpty()
    ends = {far, near}

    def hang_up() -> None:
        while ends:
            os.close(ends.pop())

    try:
        fcntl.ioctl(near, _SET_DISCIPLINE, struct.pack("=i", _SLCAN))
        found = fcntl.ioctl(near, _NAME_OF, bytes(32))
        name = found.partition(b"\0")[0].decode()
        switch(name, up=True)
        yield Slow(name, hang_up)
    finally:
        hang_up()


class HubBridge:
    """Joins the kernel's interface and a hub of emulated nodes; lives in the hub's thread."""

    def __init__(self, hub: CanHub, loop: Any) -> None:
        self._raw = RawSocket()
        self._loop = loop
        self._station = hub.join(self._out)
        loop.add_reader(self._raw.socket.fileno(), self._in)

    def _out(self, frame: Frame) -> None:
        with contextlib.suppress(OSError):  # down, or full: as on a wire, it is lost
            self._raw.send(frame.identifier | (EXTENDED if frame.extended else 0), frame.data)

    def _in(self) -> None:
        with contextlib.suppress(OSError):
            for identifier, data in self._raw.heard():
                if not identifier & (ERROR | REMOTE):
                    frame = Frame(identifier & ~EXTENDED, data, bool(identifier & EXTENDED))
                    self._station.send(frame)

    def close(self) -> None:
        self._loop.remove_reader(self._raw.socket.fileno())
        self._station.leave()
        self._raw.socket.close()
