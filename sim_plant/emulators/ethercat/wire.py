"""The segment on a network interface: a raw packet socket, faults of the link, the clock."""

from __future__ import annotations

import asyncio
import heapq
import select
import socket
import struct
import time
from collections.abc import Callable
from pathlib import Path

from sim_plant.emulators.background import BackgroundTask
from sim_plant.emulators.ethercat.capture import Capture
from sim_plant.emulators.ethercat.datagrams import ETHERTYPE
from sim_plant.emulators.ethercat.segment import Segment
from sim_plant.emulators.link_faults import LinkFaults

POLL_PERIOD = 1_000_000  # ns, of watchdogs, SYNC0 and applications without frames
MAX_FRAME = 1518
MAX_BATCH = 64  # frames that are read before the segment is polled again
NS = 1_000_000_000
SO_TIMESTAMPNS = 35  # of Linux: the kernel notes when a frame came
NOTES_SIZE = socket.CMSG_SPACE(16)

clock = time.monotonic_ns


class Wire:
    """Both directions between an interface and a segment. The interface must be up.

    The socket takes frames of type 0x88A4 only: with all types it would read its own answers.
    """

    def __init__(
        self,
        segment: Segment,
        interface: str,
        link: LinkFaults | None = None,
        capture: Path | None = None,
        longest_wait_ns: int = 0,
    ) -> None:
        """`capture`: a file for all frames as the master's side sees them.

        `longest_wait_ns`: frames that this process has left lying for longer are lost, 0: none. A
        real slave sees a frame when it is sent; one that is answered after a stall of this process
        would have inputs of a later time than its master must believe.
        """
        self.segment = segment
        self.interface = interface
        self.link = link or LinkFaults()
        self._capture = Capture(capture) if capture else None
        self._socket: socket.socket | None = None
        self._late: list[tuple[int, int, bool, bytes]] = []  # due, order, to the host, frame
        self._order = 0
        self._resume_at = 0  # ns, end of a stall
        self._longest_wait_ns = longest_wait_ns
        self._next_poll = 0
        self._last_arrival = 0  # ns
        self._task = BackgroundTask()

    # ---- as one of the emulators of an event loop ------------------------------------------------

    @property
    def address(self) -> str:
        """The interface of the segment; a master uses the other end of the pair."""
        return self.interface

    async def start(self) -> None:
        """Open the socket and serve it in the running event loop."""
        descriptor = self.open()
        asyncio.get_running_loop().add_reader(descriptor, self._on_readable)
        self._task.start(self._poll_loop())

    async def close(self) -> None:
        """Stop serving and close the socket."""
        await self._task.stop()
        if self._socket is not None:
            asyncio.get_running_loop().remove_reader(self._socket)
        self.shut()

    def _on_readable(self) -> None:
        self.receive(clock())

    async def _poll_loop(self) -> None:
        while True:
            now = clock()
            self.step(now)
            if self._resume_at > now and self._socket is not None:  # without a busy loop
                loop, descriptor = asyncio.get_running_loop(), self._socket.fileno()
                loop.remove_reader(descriptor)
                await asyncio.sleep((self._resume_at - now) / NS)
                loop.add_reader(descriptor, self._on_readable)
            await asyncio.sleep(max(0.0, (self.next_due() - clock()) / NS))

    # ---- on its own ------------------------------------------------------------------------------

    def open(self) -> int:
        """Open the socket and return its descriptor. Raises OSError."""
        self._socket = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(ETHERTYPE))
        self._socket.bind((self.interface, ETHERTYPE))
        self._socket.setblocking(False)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self._next_poll = clock()
        return self._socket.fileno()

    def shut(self) -> None:
        """Close socket and capture."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
        if self._capture is not None:
            self._capture.close()
            self._capture = None

    def serve(self, until: Callable[[], bool], *, spin: bool = False) -> None:
        """Serve the socket until a condition holds; `spin`: without sleeping, for less delay."""
        descriptor = self.open()
        try:
            while not until():
                now = clock()
                wait = 0.0 if spin else max(0.0, (self.next_due() - now) / NS)
                stalled = now < self._resume_at
                readable, _, _ = select.select([] if stalled else [descriptor], (), (), wait)
                if readable:
                    self.receive(clock())
                now = clock()
                if now >= self.next_due():
                    self.step(now)
        finally:
            self.shut()

    # ---- frames ---------------------------------------------------------------------------------

    def next_due(self) -> int:
        """Return the time of the next call of `step`, ns."""
        return min(self._next_poll, self._late[0][0]) if self._late else self._next_poll

    def step(self, now: int) -> None:
        """Deliver late frames and poll the segment."""
        while self._late and self._late[0][0] <= now:
            due, _, to_host, frame = heapq.heappop(self._late)
            if to_host:
                self._put(frame)
            else:
                self._answer(frame, due)
        for direction, to_host in ((self.link.to_device, False), (self.link.to_host, True)):
            if not direction.is_transparent(now / NS):
                self._schedule(direction.due_arrivals(now / NS), to_host)
        if now >= self._next_poll:
            self.receive(now)  # a frame that came before SYNC0 counts before it
            self.segment.poll(now)
            pulse = self.segment.next_due()
            later = POLL_PERIOD if pulse is None else min(pulse, POLL_PERIOD)
            self._next_poll = clock() + later
        if self.segment.stall_ns:
            self._resume_at = now + self.segment.stall_ns
            self.segment.stall_ns = 0

    def receive(self, now: int) -> None:
        """Read the frames that wait and answer them."""
        if self._socket is None or now < self._resume_at:
            return
        direction = self.link.to_device
        for _ in range(MAX_BATCH):
            try:
                frame, notes, _, _ = self._socket.recvmsg(MAX_FRAME, NOTES_SIZE)
            except BlockingIOError:
                return
            waited = _waited_ns(notes)
            # After an injected stall all that waited is answered: that is the fault.
            if now <= self._resume_at + POLL_PERIOD:
                waited = 0
            elif self._longest_wait_ns and waited > self._longest_wait_ns:
                self.segment.lost += 1
                continue
            if direction.is_transparent(now / NS):
                self._answer(frame, clock() - waited)
            else:
                self._schedule(direction.transmit(frame, now / NS), False)

    def _answer(self, frame: bytes, arrived: int) -> None:
        now = clock()
        if self._capture is not None:
            self._capture.write(frame, now)
        self._last_arrival = max(arrived, self._last_arrival)  # the host's time may be set
        reply = self.segment.process(frame, min(self._last_arrival, now))
        if reply is not None:
            direction = self.link.to_host
            if direction.is_transparent(now / NS):
                self._put(reply)
            else:
                self._schedule(direction.transmit(reply, now / NS), True)
        self.segment.finish_frame()

    def _schedule(self, pieces: list[tuple[float, bytes]], to_host: bool) -> None:
        for at, frame in pieces:
            self._order += 1
            heapq.heappush(self._late, (round(at * NS), self._order, to_host, frame))

    def _put(self, frame: bytes) -> None:
        if self._capture is not None:
            self._capture.write(frame, clock())
        if self._socket is not None:
            try:
                self._socket.send(frame)
            except OSError:  # the interface is down or its queue is full: a lost frame
                self.segment.lost += 1


def _waited_ns(notes: list[tuple[int, int, bytes]]) -> int:
    """Return for how long a frame with these notes of the kernel has waited; 0 without a time."""
    for level, kind, data in notes:
        if (level, kind) == (socket.SOL_SOCKET, SO_TIMESTAMPNS):
            seconds, rest = struct.unpack("=qq", data)
            waited: int = time.time_ns() - (NS * seconds + rest)
            return max(0, waited)
    return 0
