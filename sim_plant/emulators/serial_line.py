"""A serial line: a pseudo-terminal under a chosen path, with the timing of a wire."""

from __future__ import annotations

import asyncio
import contextlib
import os
import pty
import termios
import tty
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from sim_plant.emulators.background import BackgroundTask
from sim_plant.emulators.link_faults import LinkFaults
from sim_plant.units import Count, Second

POLL_PERIOD = 0.005  # s between two updates of the link faults


class SerialLineSettings(NamedTuple):
    """Settings of a line; a pseudo-terminal has no baud rate, so the host's is not checked."""

    path: Path  # a symbolic link created here; the host opens it
    baud: int
    bits_per_byte: Count = 10  # 8N1: 10; 8E1 and 8N2: 11
    paced: bool = True  # False: bytes take no time
    chunk: Count = 0  # bytes that reach the host at once; 0: a complete piece
    echo: bool = False  # a two-wire RS-485 adapter that receives its own bytes

    @property
    def byte_time(self) -> Second:
        """Time one byte takes on the wire."""
        return self.bits_per_byte / self.baud if self.paced else 0.0


class Pacer:
    """Releases pieces in order, each when its last byte would have left the wire."""

    def __init__(self, byte_time: Second, chunk: Count, out: Callable[[bytes], None]) -> None:
        """`chunk` 0: pieces are not divided."""
        self._byte_time = byte_time
        self._chunk = chunk
        self._write = out
        self._free_at = float("-inf")
        self._queue: deque[tuple[Second, bytes]] = deque()
        self._timer: asyncio.TimerHandle | None = None

    def put(self, at: Second, data: bytes) -> None:
        """Send a piece at time `at` of the running loop, or as soon as the wire is free."""
        size = self._chunk or len(data)
        for start in range(0, len(data), max(size, 1)):
            part = data[start : start + size]
            self._free_at = max(self._free_at, at) + len(part) * self._byte_time
            self._queue.append((self._free_at, part))
        if self._timer is None:
            self._pump()

    def clear(self) -> None:
        """Discard pieces that have not been released."""
        self._queue.clear()
        self._free_at = float("-inf")
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _pump(self) -> None:
        self._timer = None
        loop = asyncio.get_running_loop()
        now = loop.time()
        while self._queue and self._queue[0][0] <= now:
            self._write(self._queue.popleft()[1])
        if self._queue and self._timer is None:
            self._timer = loop.call_at(self._queue[0][0], self._pump)


class SerialLine:
    """One end of a serial line; the host may open the other end by its path repeatedly.

    Unread bytes are lost when the kernel's buffer is full, as in a UART, and counted.
    """

    def __init__(self, settings: SerialLineSettings, link: LinkFaults | None = None) -> None:
        """Create the line; start() opens it."""
        self.settings = settings
        self.link = link or LinkFaults()
        self.lost_bytes: Count = 0  # bytes that the host did not read in time
        self._receive: Callable[[bytes, Second], None] = lambda data, now: None
        self._fds: tuple[int, int] | None = None
        self._poll_task = BackgroundTask()
        self._to_device = Pacer(settings.byte_time, 0, self._deliver)
        self._to_host = Pacer(settings.byte_time, settings.chunk, self._write)

    def attach(self, receive: Callable[[bytes, Second], None]) -> None:
        """Set the callback for bytes from the host: `receive(data, now)` with the loop's time."""
        self._receive = receive

    @property
    def address(self) -> str:
        """The path a host opens."""
        return str(self.settings.path)

    @property
    def is_present(self) -> bool:
        """Whether the line exists; not whether a host has it open."""
        return self._fds is not None

    async def start(self) -> None:
        """Open the line, in a new folder if there is none.

        Raises FileExistsError if the path is a file of another kind.
        """
        self.settings.path.parent.mkdir(parents=True, exist_ok=True)
        self.plug_in()
        self._poll_task.start(self._poll_loop())

    async def close(self) -> None:
        """Close the line and remove its path."""
        await self._poll_task.stop()
        self.unplug()

    def send(self, data: bytes) -> None:
        """Send bytes to the host, after those already on the wire."""
        if self._fds is None:
            return
        now = asyncio.get_running_loop().time()
        for at, piece in self.link.to_host.transmit(data, now):
            self._to_host.put(at, piece)

    def unplug(self) -> None:
        """Unplug the adapter: the host's port fails, the path and bytes under way are lost."""
        if self._fds is None:
            return
        master, slave = self._fds
        self._fds = None
        asyncio.get_running_loop().remove_reader(master)
        self._to_host.clear()
        self._to_device.clear()
        with contextlib.suppress(FileNotFoundError):
            self.settings.path.unlink()
        os.close(slave)
        os.close(master)

    def plug_in(self) -> None:
        """Plug the adapter in again, under the same path; the host has to reopen it."""
        if self._fds is not None:
            return
        path = self.settings.path
        if path.exists() and not path.is_symlink():
            raise FileExistsError(f"{path} exists and is not a symbolic link")
        # The slave stays open here too; otherwise the master fails whenever no host has it open.
        master, slave = pty.openpty()
        tty.setraw(master)
        tty.setraw(slave)
        os.set_blocking(master, False)
        new_link = path.with_name(f".{path.name}.new")
        new_link.unlink(missing_ok=True)
        new_link.symlink_to(os.ttyname(slave))
        new_link.replace(path)
        self._fds = master, slave
        asyncio.get_running_loop().add_reader(master, self._readable)

    def _readable(self) -> None:
        if self._fds is None:
            return
        try:
            data = os.read(self._fds[0], 4096)
        except (BlockingIOError, OSError):
            return
        now = asyncio.get_running_loop().time()
        if self.settings.echo:
            self._to_host.put(now, data)
        for at, piece in self.link.to_device.transmit(data, now):
            self._to_device.put(at, piece)

    def _deliver(self, data: bytes) -> None:
        self._receive(data, asyncio.get_running_loop().time())

    def _write(self, data: bytes) -> None:
        if self._fds is None:
            return
        try:
            written = os.write(self._fds[0], data)
        except (BlockingIOError, OSError):
            written = 0
        self.lost_bytes += len(data) - written

    def _reset_speed(self) -> None:
        """Reset the speed so that the next host's settings differ from the present ones.

        A pseudo-terminal has no parity, and the C library reports an error if no part of a setting
        takes effect: the second host with 8E1 would fail where the first did not.
        """
        if self._fds is None:
            return
        attributes = termios.tcgetattr(self._fds[1])
        if attributes[4] != termios.B50:
            attributes[4] = attributes[5] = termios.B50
            termios.tcsetattr(self._fds[1], termios.TCSANOW, attributes)

    async def _poll_loop(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            if self.link.disconnected:
                self.unplug()
            else:
                self.plug_in()
                self._reset_speed()
                now = loop.time()
                for at, piece in self.link.to_host.due_arrivals(now):
                    self._to_host.put(at, piece)
                for at, piece in self.link.to_device.due_arrivals(now):
                    self._to_device.put(at, piece)
            await asyncio.sleep(POLL_PERIOD)
