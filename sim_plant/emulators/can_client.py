"""A process on the emulated CAN bus, by the text protocol of socketcand."""

from __future__ import annotations

import asyncio
import socket
from typing import TYPE_CHECKING

from sim_plant.emulators import can_frame
from sim_plant.emulators.can_frame import TextError
from sim_plant.emulators.passage import Passage
from sim_plant.units import Second

if TYPE_CHECKING:
    from sim_plant.emulators.can_hub import CanHub, Station

BACKLOG = 1 << 20  # bytes that may wait for a client before it is dropped
LONGEST = 256  # characters of a command
ALONE: Second = 0.02  # before the first frame: python-can wants the last `ok` in a read of its own


class TextClient(asyncio.Protocol):
    """A process on the bus, seen from the hub: `< open NAME >`, `< rawmode >`, then frames."""

    def __init__(self, hub: CanHub, loop: asyncio.AbstractEventLoop) -> None:
        self.station: Station | None = None
        self._hub = hub
        self._loop = loop
        self._transport: asyncio.Transport | None = None
        self._text = ""
        self.raw = False
        self._greeting = False  # frames wait until the client has read that it is in raw mode
        self._out: list[bytes] = []
        self.to_host = Passage(hub.link.to_host.branch(), loop, self._write)
        self.to_device = Passage(hub.link.to_device.branch(), loop, self._take)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Greet."""
        assert isinstance(transport, asyncio.Transport)
        transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._transport = transport
        self._hub.clients.add(self)
        transport.write(b"< hi >")

    def connection_lost(self, exc: Exception | None) -> None:
        """Leave the bus."""
        self.drop()

    def drop(self) -> None:
        """Leave the bus at once and close the connection."""
        self._hub.clients.discard(self)
        if self.station is not None:
            self.station.leave()
        if self._transport is not None and not self._transport.is_closing():
            self._transport.abort()

    def put(self, text: bytes) -> None:
        """Send in raw mode, through the link's faults."""
        if self.raw:
            self.to_host.hand(text)

    def _write(self, text: bytes) -> None:
        """What comes in one turn of the loop goes out as one."""
        if self.raw:
            if self._hub.reading is not None:
                self._hub.reading.add(self)
            elif not self._out:
                self._loop.call_soon(self.flush)
            self._out.append(text)

    def _greeted(self) -> None:
        self._greeting = False
        self.flush()

    def flush(self) -> None:
        """Write what is to be sent."""
        if self._greeting:
            return
        transport, text = self._transport, b"".join(self._out)
        self._out.clear()
        if transport is None or transport.is_closing():
            return
        if transport.get_write_buffer_size() + len(text) > BACKLOG:
            self._hub.slow += 1
            self.drop()
            return
        transport.write(text)

    def data_received(self, data: bytes) -> None:
        """Do every whole command; the rest waits for more."""
        *commands, self._text = (self._text + data.decode("ascii", "replace")).split(">")
        self._hub.reading = answered = set[TextClient]()
        try:
            for command in commands:
                self._do(command)
        finally:
            self._hub.reading = None
            for client in answered:
                client.flush()
        if len(self._text) > LONGEST:
            self._text = ""
            self._answer("error command too long")

    def _do(self, command: str) -> None:
        before, opened, words = command.rpartition("<")
        words = words.strip()
        name = words.partition(" ")[0]
        if not opened or before.strip():
            self._answer("error no command")
        elif name == "open" and self.station is None and len(words) > len("open "):
            self.station = self._hub.join(lambda frame: None)
            self._answer("ok")
        elif self.station is None:
            self._answer("error no bus opened")
        elif name == "rawmode":
            if not self.raw:
                self.raw = self._greeting = True
                self._loop.call_later(ALONE, self._greeted)
            self._answer("ok")
        elif name == "send":
            self.to_device.hand(words.encode())
        elif name == "echo":
            self._answer("echo")
        else:
            self._answer("error unknown command")

    def _take(self, words: bytes) -> None:
        """A frame that a client sends."""
        try:
            frame = can_frame.read_send(words.decode("ascii", "replace"))
        except TextError as wrong:
            self._answer(f"error {wrong}")
        else:
            if self.station is not None:
                self.station.send(frame)

    def _answer(self, words: str) -> None:
        if self._transport is not None and not self._transport.is_closing():
            if self._transport.get_write_buffer_size() > BACKLOG:
                self._hub.slow += 1
                self.drop()
                return
            self._transport.write(f"< {words} >".encode())
