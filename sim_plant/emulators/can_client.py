"""A client process on the emulated CAN bus, connected by the socketcand text protocol."""

from __future__ import annotations

import asyncio
import socket
from typing import TYPE_CHECKING

from sim_plant.emulators import can_frame
from sim_plant.emulators.can_frame import FrameTextError
from sim_plant.emulators.passage import LinkRelay
from sim_plant.units import Second

if TYPE_CHECKING:
    from sim_plant.emulators.can_hub import CanHub, Station

MAX_BACKLOG = 1 << 20  # bytes that may wait for a client before it is dropped
MAX_COMMAND_LENGTH = 256  # characters of a command
GREETING_DELAY: Second = (
    0.02  # pause before the first frame: python-can expects the last `ok` in a read of its own
)


class SocketcandClient(asyncio.Protocol):
    """Connection of a client process to the hub: `< open NAME >`, `< rawmode >`, then frames."""

    def __init__(self, hub: CanHub, loop: asyncio.AbstractEventLoop) -> None:
        self.station: Station | None = None
        self._hub = hub
        self._loop = loop
        self._transport: asyncio.Transport | None = None
        self._text = ""
        self.raw = False
        self._greeting_pending = (
            False  # frames wait until the client has read the answer to rawmode
        )
        self._pending: list[bytes] = []
        self.to_host = LinkRelay(hub.link.to_host.branch(), loop, self._queue_text)
        self.to_device = LinkRelay(hub.link.to_device.branch(), loop, self._receive_frame)

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Send the greeting and register the client."""
        assert isinstance(transport, asyncio.Transport)
        transport.get_extra_info("socket").setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._transport = transport
        self._hub.clients.add(self)
        transport.write(b"< hi >")

    def connection_lost(self, exc: Exception | None) -> None:
        """Leave the bus."""
        self.disconnect()

    def disconnect(self) -> None:
        """Leave the bus at once and close the connection."""
        self._hub.clients.discard(self)
        if self.station is not None:
            self.station.leave()
        if self._transport is not None and not self._transport.is_closing():
            self._transport.abort()

    def send_text(self, text: bytes) -> None:
        """Send in raw mode, through the link's faults."""
        if self.raw:
            self.to_host.send(text)

    def _queue_text(self, text: bytes) -> None:
        """Queue text; the text of one iteration of the loop is written at once."""
        if self.raw:
            if self._hub.clients_to_flush is not None:
                self._hub.clients_to_flush.add(self)
            elif not self._pending:
                self._loop.call_soon(self.flush)
            self._pending.append(text)

    def _end_greeting(self) -> None:
        self._greeting_pending = False
        self.flush()

    def flush(self) -> None:
        """Write the pending text."""
        if self._greeting_pending:
            return
        transport, text = self._transport, b"".join(self._pending)
        self._pending.clear()
        if transport is None or transport.is_closing():
            return
        if transport.get_write_buffer_size() + len(text) > MAX_BACKLOG:
            self._hub.dropped_clients += 1
            self.disconnect()
            return
        transport.write(text)

    def data_received(self, data: bytes) -> None:
        """Execute every complete command; the rest waits for more data."""
        *commands, self._text = (self._text + data.decode("ascii", "replace")).split(">")
        self._hub.clients_to_flush = to_flush = set[SocketcandClient]()
        try:
            for command in commands:
                self._execute(command)
        finally:
            self._hub.clients_to_flush = None
            for client in to_flush:
                client.flush()
        if len(self._text) > MAX_COMMAND_LENGTH:
            self._text = ""
            self._reply("error command too long")

    def _execute(self, command: str) -> None:
        prefix, bracket, text = command.rpartition("<")
        text = text.strip()
        name = text.partition(" ")[0]
        if not bracket or prefix.strip():
            self._reply("error no command")
        elif name == "open" and self.station is None and len(text) > len("open "):
            self.station = self._hub.join(lambda frame: None)
            self._reply("ok")
        elif self.station is None:
            self._reply("error no bus opened")
        elif name == "rawmode":
            if not self.raw:
                self.raw = self._greeting_pending = True
                self._loop.call_later(GREETING_DELAY, self._end_greeting)
            self._reply("ok")
        elif name == "send":
            self.to_device.send(text.encode())
        elif name == "echo":
            self._reply("echo")
        else:
            self._reply("error unknown command")

    def _receive_frame(self, text: bytes) -> None:
        """Send the frame of a client's `send` command to the bus."""
        try:
            frame = can_frame.parse_send(text.decode("ascii", "replace"))
        except FrameTextError as error:
            self._reply(f"error {error}")
        else:
            if self.station is not None:
                self.station.send(frame)

    def _reply(self, text: str) -> None:
        if self._transport is not None and not self._transport.is_closing():
            if self._transport.get_write_buffer_size() > MAX_BACKLOG:
                self._hub.dropped_clients += 1
                self.disconnect()
                return
            self._transport.write(f"< {text} >".encode())
