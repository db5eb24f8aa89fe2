"""A CAN bus for emulated nodes and, over TCP on loopback, for any number of other processes.

It speaks the socketcand text protocol, so python-can's `socketcand` interface can connect. Every
station except the sender receives a frame. Frames of one station keep their order, as in the queue
of a CAN interface; among waiting stations the lowest identifier has priority.
"""

from __future__ import annotations

import asyncio
import socket
from collections import deque
from collections.abc import Callable

from sim_plant.emulators import can_frame
from sim_plant.emulators.can_frame import Frame, FrameTextError
from sim_plant.emulators.link_faults import LinkFaults
from sim_plant.emulators.passage import LinkRelay
from sim_plant.emulators.schedule import Schedule
from sim_plant.units import Second

QUEUE_LENGTH = 1000  # most frames that may wait in a station
MAX_BACKLOG = 1 << 20  # bytes that may wait for a client before it is dropped
MAX_COMMAND_LENGTH = 256  # characters of a command
GREETING_DELAY: Second = (
    0.02  # pause before the first frame: python-can expects the last `ok` in a read of its own
)


class Station:
    """One node or client on the bus."""

    def __init__(self, hub: CanHub, receive: Callable[[Frame], None]) -> None:
        self.receive = receive
        self.queue: deque[Frame] = deque()
        self.overruns = 0  # frames discarded because the queue was full
        self._hub = hub

    def send(self, frame: Frame) -> None:
        """Queue a frame; it is delivered at once if the bus is free and has no bit rate."""
        if self._hub.deliver_if_idle(self, frame):
            return
        if len(self.queue) >= QUEUE_LENGTH:
            self.overruns += 1
            return
        self.queue.append(frame)
        self._hub.arbitrate()

    def leave(self) -> None:
        """Leave the bus; waiting frames are lost."""
        self.queue.clear()
        self._hub.stations.discard(self)


class CanHub:
    """The bus."""

    def __init__(self, schedule: Schedule, *, bit_rate: int | None = None) -> None:
        """`bit_rate` (bit/s) gives every frame its time on the wire; None: frames take no time."""
        self.stations: set[Station] = set()
        self.clients: set[SocketcandClient] = set()
        self.frame_count = 0  # delivered
        self.busy_time: Second = 0.0  # total time with frames on the wire; 0 without a bit rate
        self.dropped_clients = 0  # clients disconnected because they did not read
        self.link = LinkFaults()  # of the cable between the bus and the other processes
        self.clients_to_flush: set[SocketcandClient] | None = (
            None  # during a read: clients with pending text
        )
        self.schedule = schedule
        self._bit_rate = bit_rate
        self._free_at: Second = 0.0
        self._frame_on_wire = False  # a frame is on the wire
        self._delivering = False
        self._any_waiting = False  # some station may have frames; used without a bit rate only
        self._server: asyncio.Server | None = None

    def join(self, receive: Callable[[Frame], None]) -> Station:
        """Put a node on the bus; `receive` is called with every frame of the others."""
        station = Station(self, receive)
        self.stations.add(station)
        return station

    async def serve(self, host: str = "127.0.0.1", port: int = 0) -> tuple[str, int]:
        """Open the bus to other processes and return its address; port 0 selects a free one."""
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(lambda: SocketcandClient(self, loop), host, port)
        address: tuple[str, int] = self._server.sockets[0].getsockname()[:2]
        return address

    async def close(self) -> None:
        """Disconnect all clients and stop listening."""
        if self._server is not None:
            self._server.close()
        for client in list(self.clients):
            client.disconnect()
        if self._server is not None:
            await self._server.wait_closed()

    def poll(self) -> None:
        """Deliver pieces that the link's faults delayed; call it often."""
        for client in tuple(self.clients):
            client.to_host.poll()
            client.to_device.poll()

    def report_error(self, identifier: int) -> None:
        """Send a bus error to the clients; `identifier` has the bits of a Linux error frame."""
        text = f"< error {identifier | 0x20000000:08X} {self.schedule.time():.6f} >".encode()
        for client in list(self.clients):
            client.send_text(text)

    def deliver_if_idle(self, sender: Station, frame: Frame) -> bool:
        """Deliver a frame and the answers to it if the bus is idle; return whether it was."""
        if self._bit_rate is not None or self._delivering or self._any_waiting:
            return False
        self._delivering = True
        try:
            self._deliver(sender, frame)
        finally:
            self._delivering = False
        if self._any_waiting:
            self.arbitrate()
        return True

    def arbitrate(self) -> None:
        """Deliver waiting frames while the bus is free."""
        self._any_waiting = True
        if self._delivering:
            return
        self._delivering = True
        try:
            if self._bit_rate is None:
                while (sender := self._highest_priority_station()) is not None:
                    self._deliver(sender, sender.queue.popleft())
                self._any_waiting = False
            elif not self._frame_on_wire:
                self._start_frame(max(self._free_at, self.schedule.time()))
        finally:
            self._delivering = False

    def _highest_priority_station(self) -> Station | None:
        waiting = [station for station in self.stations if station.queue]
        if not waiting:
            return None
        return min(waiting, key=lambda station: station.queue[0].identifier)

    def _start_frame(self, start: Second) -> None:
        """Start the frame with the highest priority; it is delivered after its last bit."""
        sender = self._highest_priority_station()
        if sender is None or self._bit_rate is None:
            return
        self._frame_on_wire = True
        frame = sender.queue.popleft()
        duration = can_frame.frame_bits(len(frame.data), frame.extended) / self._bit_rate
        self.busy_time += duration
        self._free_at = start + duration
        self.schedule.call_at(self._free_at, self._finish_frame, sender, frame)

    def _finish_frame(self, sender: Station, frame: Frame) -> None:
        """Deliver the frame that was on the wire; the next one follows without a gap."""
        self._delivering = True
        self._frame_on_wire = False
        try:
            self._deliver(sender, frame)
            self._start_frame(self._free_at)
        finally:
            self._delivering = False

    def _deliver(self, sender: Station, frame: Frame) -> None:
        self.frame_count += 1
        for station in tuple(self.stations):
            if station is not sender:
                station.receive(frame)
        if self.clients:
            text = can_frame.format_frame(frame, self.schedule.time())
            for client in tuple(self.clients):
                if client.station is not sender:
                    client.send_text(text)


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
