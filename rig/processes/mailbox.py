"""A shared slot with one writer and any readers: the newest value counts, nothing queues.

The writer stores a sequence number before and after the value; a reader that finds the two
different, or odd timing, keeps what it had. Used for people -> loop, and for every slow device
beside the loop. A level, not an event: the value stands until the next post.
"""

import mmap
import os
from typing import Any, NamedTuple

from controllers.signals import Index, Second
from rig.recording.row_layout import layout, leaves, packer

_SLOT = mmap.PAGESIZE


class Request(NamedTuple):
    """What people or the supervisor ask of the loop, posted again and again as a sign of life."""

    request: Index  # rig.realtime.safety.REQUEST_*
    heartbeat: Second  # CLOCK_MONOTONIC when the supervisor posted it


def create() -> int:
    """Make the shared memory of one slot; returns its file descriptor (inheritable)."""
    fd = os.memfd_create("wec-rig-mailbox", 0)
    os.ftruncate(fd, _SLOT)
    return fd


class Mailbox:
    """One end of a slot that holds values of ``word_type`` (a NamedTuple of floats and ints)."""

    def __init__(self, fd: int, word_type: type) -> None:
        self._map = mmap.mmap(fd, _SLOT)
        self._layout = layout(word_type)
        self._pack = packer(word_type)
        self._type = word_type
        if any(len(leaf.path) > 1 for leaf in leaves(word_type)):
            raise TypeError(f"{word_type.__name__} is nested; a mailbox holds one flat word")
        if 16 + self._layout.size > _SLOT:
            raise ValueError(f"{word_type.__name__} does not fit in a mailbox")
        self._words = memoryview(self._map).cast("q")
        self._last: Any = None
        self._read = 0  # sequence number of the value in _last

    def post(self, value: Any) -> None:
        """Replace the value."""
        sequence = self._words[1] + 1
        self._words[0] = sequence
        self._pack(self._map, 16, value)
        self._words[1] = sequence

    def read(self) -> Any:
        """The newest whole value, or None before the first post."""
        before = self._words[1]
        if before == self._read:
            return self._last
        value = self._layout.unpack_from(self._map, 16)
        if self._words[0] == before == self._words[1]:
            self._last = self._type(*value)
            self._read = before
        return self._last
