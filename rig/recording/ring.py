"""Rows from the loop to the logger through shared memory: one producer, one consumer, no lock.

The memory is an anonymous memfd made by the supervisor and inherited by both ends, so it lives as
long as any of them does and a killed process loses nothing that is in it. The consumer moves the
tail only when rows are safe on disk; a restarted logger goes on from there.
"""

import fcntl
import mmap
import os
import time
from collections.abc import Callable
from enum import IntEnum
from typing import Any

from rig.recording.row_layout import layout, packer

CAPACITY = 65536  # rows: 65 s at 1 kHz
_HEADER = mmap.PAGESIZE
_PATIENCE = 2.0  # s a full ring is waited for once a stop is wanted
_MAGIC = 0x57454352494E4731  # "WECRING1"


class _Word(IntEnum):
    """Header words, 8 bytes each, aligned: a store of one is a single store."""

    MAGIC = 0
    ROW_SIZE = 1
    CAPACITY = 2
    HEAD = 3  # rows put; written by the producer only
    TAIL = 4  # rows safe on disk; written by the consumer only
    DROPPED = 5  # rows lost because the ring was full
    STATE = 6
    ABANDONED = 7  # set by the supervisor when the consumer is lost for good
    START_UTC = 8  # ns since 1970 of run time zero, set by the producer before its first row


class Producer(IntEnum):
    """State of the producing end."""

    ABSENT = 0
    RUNNING = 1
    FINISHED = 2


def create(row_type: type, capacity: int = CAPACITY) -> int:
    """Make the shared memory for a ring of rows; returns its file descriptor (inheritable)."""
    size = layout(row_type).size
    fd = os.memfd_create("wec-rig-ring", 0)
    os.ftruncate(fd, _HEADER + size * capacity)
    with mmap.mmap(fd, _HEADER) as header:
        words = memoryview(header).cast("q")
        words[_Word.ROW_SIZE] = size
        words[_Word.CAPACITY] = capacity
        words[_Word.MAGIC] = _MAGIC
        words.release()
    return fd


def consume(fd: int, *, wait: bool = True) -> int:
    """Lock a ring for its one consumer; returns the descriptor that holds the lock until closed.

    The lock ends with its process, whatever ends that. It is not inherited with ``fd``: each
    consumer opens the memory again. Waits for another consumer to end, or raises BlockingIOError.
    """
    own = os.open(f"/proc/self/fd/{fd}", os.O_RDWR | os.O_CLOEXEC)
    try:
        fcntl.flock(own, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BaseException:
        os.close(own)
        raise
    return own


def consumed(fd: int) -> bool:
    """Whether a consumer holds the lock of a ring."""
    try:
        os.close(consume(fd, wait=False))
    except BlockingIOError:
        return True
    return False


class _End:
    """What both ends share: the mapping and its header words."""

    def __init__(self, fd: int) -> None:
        self._map = mmap.mmap(fd, os.fstat(fd).st_size)
        self._words = memoryview(self._map)[:_HEADER].cast("q")
        if self._words[_Word.MAGIC] != _MAGIC:
            raise ValueError("this file descriptor is not a ring of rows")
        self.row_size: int = self._words[_Word.ROW_SIZE]
        self.capacity: int = self._words[_Word.CAPACITY]

    @property
    def head(self) -> int:
        """Rows put so far."""
        return self._words[_Word.HEAD]

    @property
    def tail(self) -> int:
        """Rows safe on disk."""
        return self._words[_Word.TAIL]

    @property
    def dropped(self) -> int:
        """Rows lost because the ring was full."""
        return self._words[_Word.DROPPED]

    @property
    def state(self) -> int:
        """`Producer` state."""
        return self._words[_Word.STATE]

    @property
    def start_utc_ns(self) -> int:
        """UTC of run time zero, nanoseconds since 1970; 0 until the producer has a clock."""
        return self._words[_Word.START_UTC]

    @property
    def abandoned(self) -> bool:
        """Nobody will save rows any more."""
        return bool(self._words[_Word.ABANDONED])


class Writer(_End):
    """The loop's end.

    ``wait``: a full ring is waited for (virtual clock) or drops (real). ``hurried`` tells whether
    somebody wants the loop to stop: then a ring that stays full is not waited for any longer.
    """

    def __init__(
        self,
        fd: int,
        row_type: type,
        *,
        wait: bool,
        hurried: Callable[[], bool] = lambda: False,
    ) -> None:
        super().__init__(fd)
        packed = layout(row_type)
        if packed.size != self.row_size:
            raise ValueError(f"ring holds rows of {self.row_size} bytes, not {packed.size}")
        self._pack = packer(row_type)
        self._wait = wait
        self._hurried = hurried
        self._next = self.head
        self._words[_Word.STATE] = Producer.RUNNING

    def start(self, utc_ns: int) -> None:
        """Say when run time zero is; with the rows, so that whoever saves them has it too."""
        self._words[_Word.START_UTC] = utc_ns

    def put(self, row: Any) -> None:
        """Store a row, then show it by moving the head."""
        words, head, capacity = self._words, self._next, self.capacity
        if head - words[_TAIL] >= capacity and not self._make_room(head):
            words[_DROPPED] += 1
            return
        self._pack(self._map, _HEADER + (head % capacity) * self.row_size, row)
        self._next = head + 1
        words[_HEAD] = head + 1

    def _make_room(self, head: int) -> bool:
        until = time.monotonic() + _PATIENCE
        while self._wait and not self.abandoned:
            if head - self.tail < self.capacity:
                return True
            if time.monotonic() > until and self._hurried():
                self._wait = False
            time.sleep(0.001)
        return False

    def finish(self) -> None:
        """Say that no more rows will come."""
        self._words[_Word.STATE] = Producer.FINISHED


_HEAD, _TAIL, _DROPPED = int(_Word.HEAD), int(_Word.TAIL), int(_Word.DROPPED)


class TornRowError(RuntimeError):
    """A row whose first and last tick differ: it was overwritten while it was read."""


class Reader(_End):
    """The logger's end (who takes rows holds the lock, `consume`), or a bystander's that peeks."""

    def __init__(self, fd: int) -> None:
        super().__init__(fd)
        self._taken = self.tail
        self._seen = self._taken

    def take(self, most: int = 8192) -> bytes:
        """Whole rows not taken yet, oldest first, at most ``most``; b"" when there are none.

        Only rows below the head of the poll before are taken, all of them once the producer has
        finished or is known dead (`bury`).
        """
        ready = self._seen
        finished = self.state == Producer.FINISHED
        self._seen = self.head
        if finished:
            ready = self._seen
        count = min(ready - self._taken, most)
        if count <= 0:
            return b""
        start = self._taken % self.capacity
        count = min(count, self.capacity - start)
        at = _HEADER + start * self.row_size
        block = self._map[at : at + count * self.row_size]
        self._check(block)
        self._taken += count
        return block

    def bury(self) -> None:
        """Say on behalf of a dead producer that no more rows will come."""
        self._words[_Word.STATE] = Producer.FINISHED

    def abandon(self) -> None:
        """Tell the producer not to wait for room any more: nobody will make any."""
        self._words[_Word.ABANDONED] = 1

    def commit(self) -> None:
        """Tell the producer that all rows taken so far are safe."""
        self._words[_TAIL] = self._taken

    @property
    def uncommitted(self) -> int:
        """Rows taken but not committed."""
        return self._taken - self.tail

    @property
    def pending(self) -> int:
        """Rows in the ring that are not taken yet."""
        return self.head - self._taken

    def latest(self) -> bytes | None:
        """The newest whole row, for a bystander; None before the first."""
        for _ in range(8):
            head = self.head
            if head == 0:
                return None
            at = _HEADER + ((head - 1) % self.capacity) * self.row_size
            row = self._map[at : at + self.row_size]
            if row[:8] == row[-8:] and self.head - head < self.capacity // 2:
                return row
        return None

    def kept(self) -> bytes:
        """The newest rows that are still in memory, oldest first, for a bystander.

        Of a ring that nobody writes any more; of a living one the oldest may be overwritten.
        """
        size, capacity, head = self.row_size, self.capacity, self.head
        split = _HEADER + (head % capacity) * size
        if head < capacity:
            return self._map[_HEADER:split]
        return self._map[split : _HEADER + capacity * size] + self._map[_HEADER:split]

    def _check(self, block: bytes) -> None:
        words, step = memoryview(block).cast("q"), self.row_size // 8
        if words[::step].tolist() != words[step - 1 :: step].tolist():
            raise TornRowError("a row was overwritten while it was read")
