"""A serial line: a pseudo-terminal under a path of one's choice, paced as a wire would be."""

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

from sim_plant.emulators.background import Background
from sim_plant.emulators.link_faults import LinkFaults
from sim_plant.units import Count, Second

TEND = 0.005  # s between two looks at what the link faults hold


class LineSettings(NamedTuple):
    """How a line is set; a pseudo-terminal itself knows no baud, so nothing checks the host's."""

    path: Path  # a symbolic link made here; the host opens it
    baud: int
    bits_per_byte: Count = 10  # 8N1: 10; 8E1 and 8N2: 11
    paced: bool = True  # False: bytes take no time
    chunk: Count = 0  # bytes that reach the host at once; 0: a whole piece
    echo: bool = False  # a two-wire RS-485 adapter that hears itself

    @property
    def byte_time(self) -> Second:
        """Time one byte takes on the wire."""
        return self.bits_per_byte / self.baud if self.paced else 0.0


class Pacer:
    """Lets pieces out in order, each when its last byte would have left the wire."""

    def __init__(self, byte_time: Second, chunk: Count, out: Callable[[bytes], None]) -> None:
        """`chunk` 0: pieces stay whole."""
        self._byte_time = byte_time
        self._chunk = chunk
        self._out = out
        self._free = float("-inf")
        self._queue: deque[tuple[Second, bytes]] = deque()
        self._timer: asyncio.TimerHandle | None = None

    def put(self, at: Second, data: bytes) -> None:
        """Send a piece at time `at` of the running loop, or as soon as the wire is free."""
        size = self._chunk or len(data)
        for start in range(0, len(data), max(size, 1)):
            part = data[start : start + size]
            self._free = max(self._free, at) + len(part) * self._byte_time
            self._queue.append((self._free, part))
        if self._timer is None:
            self._pump()

    def clear(self) -> None:
        """Forget what has not left yet."""
        self._queue.clear()
        self._free = float("-inf")
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _pump(self) -> None:
        self._timer = None
        loop = asyncio.get_running_loop()
        now = loop.time()
        while self._queue and self._queue[0][0] <= now:
            self._out(self._queue.popleft()[1])
        if self._queue and self._timer is None:
            self._timer = loop.call_at(self._queue[0][0], self._pump)


class SerialLine:
    """One end of a serial line; the host opens the other by its path, as often as it likes.

    Bytes nobody reads are lost when the kernel's buffer is full, as in a UART, and counted.
    """

    def __init__(self, settings: LineSettings, link: LinkFaults | None = None) -> None:
        """Nothing is opened before start()."""
        self.settings = settings
        self.link = link or LinkFaults()
        self.lost: Count = 0  # bytes the host did not fetch in time
        self._receive: Callable[[bytes, Second], None] = lambda data, now: None
        self._fds: tuple[int, int] | None = None
        self._tending = Background()
        self._down = Pacer(settings.byte_time, 0, self._deliver)
        self._up = Pacer(settings.byte_time, settings.chunk, self._write)

    def attach(self, receive: Callable[[bytes, Second], None]) -> None:
        """Have `receive(data, now)` called with what the host sends; `now` is the loop's time."""
        self._receive = receive

    @property
    def address(self) -> str:
        """The path a host opens."""
        return str(self.settings.path)

    @property
    def up(self) -> bool:
        """Whether the line is there; not whether a host has it open."""
        return self._fds is not None

    async def start(self) -> None:
        """Offer the line. Raises FileExistsError if the path is taken by something else."""
        self.bring_back()
        self._tending.start(self._tend())

    async def close(self) -> None:
        """Hang up for good and take the path away."""
        await self._tending.stop()
        self.hang_up()

    def send(self, data: bytes) -> None:
        """Send bytes to the host, after what is already on the wire."""
        if self._fds is None:
            return
        now = asyncio.get_running_loop().time()
        for at, piece in self.link.to_host.pass_on(data, now):
            self._up.put(at, piece)

    def hang_up(self) -> None:
        """Pull the adapter: the host's port fails, the path is gone, bytes under way are lost."""
        if self._fds is None:
            return
        master, slave = self._fds
        self._fds = None
        asyncio.get_running_loop().remove_reader(master)
        self._up.clear()
        self._down.clear()
        with contextlib.suppress(FileNotFoundError):
            self.settings.path.unlink()
        os.close(slave)
        os.close(master)

    def bring_back(self) -> None:
        """Plug the adapter in again, under the same path; the host has to open it anew."""
        if self._fds is not None:
            return
        path = self.settings.path
        if path.exists() and not path.is_symlink():
            raise FileExistsError(f"{path} is there and no symbolic link")
        # The slave stays open here too: else the master fails whenever no host has it open.
        master, slave = pty.openpty()
        tty.setraw(master)
        tty.setraw(slave)
        os.set_blocking(master, False)
        fresh = path.with_name(f".{path.name}.new")
        fresh.unlink(missing_ok=True)
        fresh.symlink_to(os.ttyname(slave))
        fresh.replace(path)
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
            self._up.put(now, data)
        for at, piece in self.link.to_device.pass_on(data, now):
            self._down.put(at, piece)

    def _deliver(self, data: bytes) -> None:
        self._receive(data, asyncio.get_running_loop().time())

    def _write(self, data: bytes) -> None:
        if self._fds is None:
            return
        try:
            written = os.write(self._fds[0], data)
        except (BlockingIOError, OSError):
            written = 0
        self.lost += len(data) - written

    def _forget_speed(self) -> None:
        """Let the next host's settings differ from the last one's.

        A pseudo-terminal knows no parity, and the C library calls a setting of which nothing was
        taken an error: the second host with 8E1 would fail where the first did not.
        """
        if self._fds is None:
            return
        attributes = termios.tcgetattr(self._fds[1])
        if attributes[4] != termios.B50:
            attributes[4] = attributes[5] = termios.B50
            termios.tcsetattr(self._fds[1], termios.TCSANOW, attributes)

    async def _tend(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            if self.link.disconnected:
                self.hang_up()
            else:
                self.bring_back()
                self._forget_speed()
                now = loop.time()
                for at, piece in self.link.to_host.due(now):
                    self._up.put(at, piece)
                for at, piece in self.link.to_device.due(now):
                    self._down.put(at, piece)
            await asyncio.sleep(TEND)
