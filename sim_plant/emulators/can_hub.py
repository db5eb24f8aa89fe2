"""A CAN bus for emulated nodes and, over TCP on loopback, for any number of other processes.

It speaks the socketcand text protocol, so python-can's `socketcand` interface joins it. Who sends
a frame is the only one who does not get it. Frames of one station keep their order, as in the
queue of a CAN interface; among stations that wait the lowest identifier goes first.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable

from sim_plant.emulators import can_frame
from sim_plant.emulators.can_client import TextClient
from sim_plant.emulators.can_frame import Frame
from sim_plant.emulators.link_faults import LinkFaults
from sim_plant.emulators.schedule import Schedule
from sim_plant.units import Second

QUEUE = 1000  # frames that may wait in a station


class Station:
    """One place on the bus."""

    def __init__(self, hub: CanHub, receive: Callable[[Frame], None]) -> None:
        self.receive = receive
        self.waiting: deque[Frame] = deque()
        self.overruns = 0  # frames not taken as too many wait
        self._hub = hub

    def send(self, frame: Frame) -> None:
        """Queue a frame; it is delivered at once if the bus is free and has no bit rate."""
        if self._hub.passes_at_once(self, frame):
            return
        if len(self.waiting) >= QUEUE:
            self.overruns += 1
            return
        self.waiting.append(frame)
        self._hub.arbitrate()

    def leave(self) -> None:
        """Leave the bus; what waits is lost."""
        self.waiting.clear()
        self._hub.stations.discard(self)


class CanHub:
    """The bus."""

    def __init__(self, schedule: Schedule, *, bit_rate: int | None = None) -> None:
        """`bit_rate` in bit/s makes every frame take its time on the wire; None: no time at all."""
        self.stations: set[Station] = set()
        self.clients: set[TextClient] = set()
        self.frames = 0  # delivered
        self.busy: Second = 0.0  # with frames on the wire; 0 without a bit rate
        self.slow = 0  # clients dropped as they did not read
        self.link = LinkFaults()  # of the cable between the bus and the other processes
        self.reading: set[TextClient] | None = None  # during a read: who has something to send
        self._schedule = schedule
        self._bit_rate = bit_rate
        self._free_at: Second = 0.0
        self._occupied = False  # a frame is on the wire
        self._delivering = False
        self._any_waits = False  # some station may have frames; told without a bit rate only
        self._server: asyncio.Server | None = None

    def join(self, receive: Callable[[Frame], None]) -> Station:
        """Put a node on the bus; `receive` gets every frame of others."""
        station = Station(self, receive)
        self.stations.add(station)
        return station

    async def serve(self, host: str = "127.0.0.1", port: int = 0) -> tuple[str, int]:
        """Open the bus to other processes and give its address; port 0 takes a free one."""
        loop = asyncio.get_running_loop()
        self._server = await loop.create_server(lambda: TextClient(self, loop), host, port)
        found: tuple[str, int] = self._server.sockets[0].getsockname()[:2]
        return found

    async def close(self) -> None:
        """Drop all clients and take no more."""
        if self._server is not None:
            self._server.close()
        for client in list(self.clients):
            client.drop()
        if self._server is not None:
            await self._server.wait_closed()

    def tend(self) -> None:
        """Let come what the link's faults held; to be called often."""
        for client in tuple(self.clients):
            client.to_host.tend()
            client.to_device.tend()

    def report_error(self, identifier: int) -> None:
        """Tell clients of a bus error; `identifier` in the bits of an error frame of Linux."""
        text = f"< error {identifier | 0x20000000:08X} {self._schedule.time():.6f} >".encode()
        for client in list(self.clients):
            client.put(text)

    def passes_at_once(self, sender: Station, frame: Frame) -> bool:
        """Deliver a frame that waits for nobody, and what it was answered with."""
        if self._bit_rate is not None or self._delivering or self._any_waits:
            return False
        self._delivering = True
        try:
            self._deliver(sender, frame)
        finally:
            self._delivering = False
        if self._any_waits:
            self.arbitrate()
        return True

    def arbitrate(self) -> None:
        """Deliver what waits, as far as the bus is free."""
        self._any_waits = True
        if self._delivering:
            return
        self._delivering = True
        try:
            if self._bit_rate is None:
                while (sender := self._winner()) is not None:
                    self._deliver(sender, sender.waiting.popleft())
                self._any_waits = False
            elif not self._occupied:
                self._occupy(max(self._free_at, self._schedule.time()))
        finally:
            self._delivering = False

    def _winner(self) -> Station | None:
        waiting = [station for station in self.stations if station.waiting]
        if not waiting:
            return None
        return min(waiting, key=lambda station: station.waiting[0].identifier)

    def _occupy(self, start: Second) -> None:
        """Put the frame that wins on the wire; it is delivered when its last bit is over."""
        sender = self._winner()
        if sender is None or self._bit_rate is None:
            return
        self._occupied = True
        frame = sender.waiting.popleft()
        taken = can_frame.bits(len(frame.data), frame.extended) / self._bit_rate
        self.busy += taken
        self._free_at = start + taken
        self._schedule.call_at(self._free_at, self._over, sender, frame)

    def _over(self, sender: Station, frame: Frame) -> None:
        """Deliver the frame that was on the wire; the next one follows without a gap."""
        self._delivering = True
        self._occupied = False
        try:
            self._deliver(sender, frame)
            self._occupy(self._free_at)
        finally:
            self._delivering = False

    def _deliver(self, sender: Station, frame: Frame) -> None:
        self.frames += 1
        for station in tuple(self.stations):
            if station is not sender:
                station.receive(frame)
        if self.clients:
            text = can_frame.written(frame, self._schedule.time())
            for client in tuple(self.clients):
                if client.station is not sender:
                    client.put(text)
