"""Ring of rows from the loop to the logger: shared memory, one producer, one consumer, no lock.

The memory is an anonymous memfd that the supervisor creates and both ends inherit: it lives as
long as any of them does, and a killed process loses none of its rows. The consumer moves the tail
only when rows are safe on disk; a restarted logger continues from there.
"""

import ctypes
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
_FULL_RING_TIMEOUT = 2.0  # s to wait for space in a full ring after a stop request
_MAGIC = 0x57454352494E4731  # "WECRING1"


class _Field(IntEnum):
    """Header fields, 8 bytes each, aligned: writing one is a single store."""

    MAGIC = 0
    ROW_SIZE = 1
    CAPACITY = 2
    HEAD = 3  # rows stored; written by the producer only
    TAIL = 4  # rows safe on disk; written by the consumer only
    DROPPED = 5  # rows lost because the ring was full
    STATE = 6
    ABANDONED = 7  # set by the supervisor when no consumer will come any more
    START_UTC = 8  # UTC of run time zero, ns since 1970; set by the producer before its first row
    WAITED = 9  # ns that the producer waited for space


class ProducerState(IntEnum):
    """State of the producer."""

    ABSENT = 0
    RUNNING = 1
    FINISHED = 2


def create(row_type: type, capacity: int = CAPACITY) -> int:
    """Create the shared memory of a ring; return its file descriptor (inheritable)."""
    size = layout(row_type).size
    fd = os.memfd_create("wec-rig-ring", 0)
    os.ftruncate(fd, _HEADER + size * capacity)
    with mmap.mmap(fd, _HEADER) as mapping:
        header = memoryview(mapping).cast("q")
        header[_Field.ROW_SIZE] = size
        header[_Field.CAPACITY] = capacity
        header[_Field.MAGIC] = _MAGIC
        header.release()
    return fd


def lock_consumer(fd: int, *, wait: bool = True) -> int:
    """Lock a ring for its one consumer; return the descriptor that holds the lock until closed.

    The lock ends with its process, however that ends. It is not inherited with ``fd``: each
    consumer opens the memory again. Wait for another consumer to end, or raise BlockingIOError.
    """
    lock_fd = os.open(f"/proc/self/fd/{fd}", os.O_RDWR | os.O_CLOEXEC)
    try:
        fcntl.flock(lock_fd, fcntl.LOCK_EX if wait else fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BaseException:
        os.close(lock_fd)
        raise
    return lock_fd


def has_consumer(fd: int) -> bool:
    """Return whether a consumer holds the lock of a ring."""
    try:
        os.close(lock_consumer(fd, wait=False))
    except BlockingIOError:
        return True
    return False


def _header_value(field: _Field, doc: str) -> Any:
    """Return a property with the present value of a header field."""
    at = int(field)
    return property(lambda ring: ring._header[at], doc=doc)


class _Ring:
    """The mapping and header fields that both ends share."""

    head: int = _header_value(_Field.HEAD, "Number of rows stored so far.")
    tail: int = _header_value(_Field.TAIL, "Number of rows safe on disk.")
    dropped: int = _header_value(_Field.DROPPED, "Number of rows lost because the ring was full.")
    state: int = _header_value(_Field.STATE, "`ProducerState`.")
    abandoned: int = _header_value(_Field.ABANDONED, "1: no consumer will save rows any more.")
    start_utc_ns: int = _header_value(
        _Field.START_UTC, "UTC of run time zero, ns since 1970; 0 until the producer has a clock."
    )
    waited_ns: int = _header_value(_Field.WAITED, "Time that the producer waited for space, ns.")

    def __init__(self, fd: int, access: int = mmap.PROT_READ | mmap.PROT_WRITE) -> None:
        self._map = mmap.mmap(fd, os.fstat(fd).st_size, prot=access)
        self._header = memoryview(self._map)[:_HEADER].cast("q")
        if self._header[_Field.MAGIC] != _MAGIC:
            raise ValueError("this file descriptor is not a ring of rows")
        self.row_size: int = self._header[_Field.ROW_SIZE]
        self.capacity: int = self._header[_Field.CAPACITY]


class RingWriter(_Ring):
    """The loop's end of the ring.

    ``wait``: wait for space in a full ring (virtual clock) instead of dropping rows (real clock).
    ``stop_requested`` returns whether the loop should stop: then `put` waits no longer than
    2 s for space.
    """

    def __init__(
        self,
        fd: int,
        row_type: type,
        *,
        wait: bool,
        stop_requested: Callable[[], bool] = lambda: False,
    ) -> None:
        super().__init__(fd)
        row_struct = layout(row_type)
        if row_struct.size != self.row_size:
            raise ValueError(f"ring holds rows of {self.row_size} bytes, not {row_struct.size}")
        self._pack = packer(row_type)
        self._address = ctypes.addressof(ctypes.c_char.from_buffer(self._map))
        self._spare = bytearray(self.row_size)  # for rows that a full ring drops
        self._spare_address = ctypes.addressof(ctypes.c_char.from_buffer(self._spare))
        self._dropping = False
        self._wait = wait
        self._stop_requested = stop_requested
        self._next = self._limit = self.head  # numbers of the next row; of the first without place
        self._lap_address = 0  # that row number zero would have in this lap of the ring
        self._header[_Field.STATE] = ProducerState.RUNNING

    def start(self, utc_ns: int) -> None:
        """Set the UTC of run time zero, stored with the rows so that any consumer has it."""
        self._header[_Field.START_UTC] = utc_ns

    def put(self, row: Any) -> None:
        """Store a row, then publish it by moving the head."""
        address, _ = self.reserve()
        if not self._dropping:
            self._pack(self._map, address - self._address, row)
        self.publish()

    def reserve(self, max_rows: int = 1) -> tuple[int, int]:
        """Return the address for the next rows and their number, at least 1.

        In a full ring the address is that of one row that will be dropped.
        """
        count = self._limit - self._next
        if count < max_rows:
            count = self._find_free()
            if self._dropping:
                return self._spare_address, 1
        address = self._lap_address + self._next * self.row_size
        return address, max_rows if max_rows < count else count

    def publish(self, count: int = 1) -> None:
        """Publish rows at the reserved address by moving the head, or count them as dropped."""
        if self._dropping:
            self._header[_DROPPED] += count
        else:
            self._header[_HEAD] = self._next = self._next + count

    def _find_free(self) -> int:
        """Return the number of free places from the next row to the end of the memory.

        They stay free until rows are stored there, so most rows need no look at the tail.
        """
        head, capacity = self._next, self.capacity
        free = capacity - head + self._header[_TAIL]
        self._dropping = free <= 0 and not self._wait_for_space(head)
        lap, first = divmod(head, capacity)
        count = 0 if self._dropping else min(max(free, 1), capacity - first)
        self._limit = head + count
        self._lap_address = self._address + _HEADER - lap * capacity * self.row_size
        return count

    def _wait_for_space(self, head: int) -> bool:
        began = time.monotonic()
        has_space = False
        while self._wait and not self.abandoned and not has_space:
            if time.monotonic() > began + _FULL_RING_TIMEOUT and self._stop_requested():
                self._wait = False
            time.sleep(0.001)
            has_space = head - self.tail < self.capacity
        self._header[_Field.WAITED] += round(1e9 * (time.monotonic() - began))
        return has_space

    def finish(self) -> None:
        """Mark the end of the rows."""
        self._header[_Field.STATE] = ProducerState.FINISHED


_HEAD, _TAIL, _DROPPED = int(_Field.HEAD), int(_Field.TAIL), int(_Field.DROPPED)


class TornRowError(RuntimeError):
    """A row whose first and last tick differ: it was overwritten while being read."""


class RingReader(_Ring):
    """The logger's end of the ring (it holds `lock_consumer`), or an observer's."""

    def __init__(self, fd: int) -> None:
        super().__init__(fd)
        self._memory = memoryview(self._map)
        self._taken = self.tail
        self._polled_head = self._taken

    def take(self, max_rows: int = 8192) -> memoryview:
        """Take whole rows, oldest first, at most ``max_rows``; empty when there are none.

        The rows stay in the ring's memory: read them before `commit`, which frees their places.
        Only rows below the head of the previous poll are taken; all of them once the producer has
        finished or is known to be dead (`mark_finished`).
        """
        ready = self._polled_head
        finished = self.state == ProducerState.FINISHED
        self._polled_head = self.head
        if finished:
            ready = self._polled_head
        count = min(ready - self._taken, max_rows)
        start = self._taken % self.capacity
        count = max(0, min(count, self.capacity - start))
        offset = _HEADER + start * self.row_size
        block = self._memory[offset : offset + count * self.row_size]
        self._check(block)
        self._taken += count
        return block

    def mark_finished(self) -> None:
        """Mark the end of the rows on behalf of a dead producer."""
        self._header[_Field.STATE] = ProducerState.FINISHED

    def abandon(self) -> None:
        """Make the producer stop waiting for space, because no consumer is left."""
        self._header[_Field.ABANDONED] = 1

    def commit(self) -> None:
        """Tell the producer that all rows taken so far are on disk."""
        self._header[_TAIL] = self._taken

    @property
    def uncommitted(self) -> int:
        """Number of rows taken but not committed."""
        return self._taken - self.tail

    @property
    def pending(self) -> int:
        """Number of rows in the ring that are not taken yet."""
        return self.head - self._taken

    def latest(self) -> bytes | None:
        """Return the newest whole row, for an observer; None before the first."""
        for _ in range(8):
            head = self.head
            if head == 0:
                return None
            offset = _HEADER + ((head - 1) % self.capacity) * self.row_size
            row = self._map[offset : offset + self.row_size]
            if row[:8] == row[-8:] and self.head - head < self.capacity // 2:
                return row
        return None

    def remaining_rows(self) -> bytes:
        """Return the newest rows still in memory, oldest first, for an observer.

        Meant for a ring without a producer; in an active ring the oldest may be overwritten.
        """
        size, capacity, head = self.row_size, self.capacity, self.head
        split = _HEADER + (head % capacity) * size
        if head < capacity:
            return self._map[_HEADER:split]
        return self._map[split : _HEADER + capacity * size] + self._map[_HEADER:split]

    def _check(self, block: memoryview) -> None:
        numbers, step = block.cast("q"), self.row_size // 8
        if numbers[::step].tolist() != numbers[step - 1 :: step].tolist():
            raise TornRowError("a row was overwritten while it was read")


class RingView(_Ring):
    """A view of a ring by another process, which cannot change it: its map is read-only."""

    def __init__(self, fd: int) -> None:
        """``fd`` may be open for reading only."""
        super().__init__(fd, mmap.PROT_READ)

    def copy(self, first: int, count: int) -> bytes:
        """Return a copy of rows by number, without regard to whether they are whole.

        The rows end at the end of the memory: there may be fewer than ``count``.
        """
        start = first % self.capacity
        offset = _HEADER + start * self.row_size
        return self._map[offset : offset + min(count, self.capacity - start) * self.row_size]
