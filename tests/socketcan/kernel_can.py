"""Kernel interfaces for the SocketCAN tests: switched up and down, slow, bridged to a hub."""

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
        interface = fcntl.ioctl(any_socket, _FLAGS, struct.pack("=16sh14x", name.encode(), 0))
        (flags,) = struct.unpack_from("=h", interface, 16)
        flags = flags | _UP if up else flags & ~_UP
        fcntl.ioctl(any_socket, _SET_FLAGS, struct.pack("=16sh14x", name.encode(), flags))


class RawSocket:
    """A CAN station on a raw socket, without any library."""

    def __init__(self) -> None:
        self.socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self.socket.bind((NAME,))
        self.socket.setblocking(False)

    def send(self, identifier: int, data: bytes = b"", length: int | None = None) -> None:
        size = len(data) if length is None else length
        self.socket.send(FRAME.pack(identifier, size, data.ljust(8, b"\0")))

    def received(self) -> Iterator[tuple[int, bytes]]:
        """Yield the frames received since the last call."""
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
    """An interface over a serial line whose far end is not read."""

    name: str
    hang_up: Callable[[], None]


@contextmanager
def slow_interface() -> Iterator[Slow]:
    """Set up a slcan interface of the kernel on a pseudo-terminal."""
    far, near = pty.openpty()
    ends = {far, near}

    def hang_up() -> None:
        while ends:
            os.close(ends.pop())

    try:
        fcntl.ioctl(near, _SET_DISCIPLINE, struct.pack("=i", _SLCAN))
        interface = fcntl.ioctl(near, _NAME_OF, bytes(32))
        name = interface.partition(b"\0")[0].decode()
        switch(name, up=True)
        yield Slow(name, hang_up)
    finally:
        hang_up()


class HubBridge:
    """Bridge between the kernel's interface and a hub of emulated nodes, in the hub's thread."""

    def __init__(self, hub: CanHub, loop: Any) -> None:
        self._raw = RawSocket()
        self._loop = loop
        self._station = hub.join(self._out)
        loop.add_reader(self._raw.socket.fileno(), self._in)

    def _out(self, frame: Frame) -> None:
        with contextlib.suppress(
            OSError
        ):  # interface down, or buffer full: the frame is lost, as on a wire
            self._raw.send(frame.identifier | (EXTENDED if frame.extended else 0), frame.data)

    def _in(self) -> None:
        with contextlib.suppress(OSError):
            for identifier, data in self._raw.received():
                if not identifier & (ERROR | REMOTE):
                    frame = Frame(identifier & ~EXTENDED, data, bool(identifier & EXTENDED))
                    self._station.send(frame)

    def close(self) -> None:
        self._loop.remove_reader(self._raw.socket.fileno())
        self._station.leave()
        self._raw.socket.close()
