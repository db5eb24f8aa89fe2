"""A shared slot with one writer and any number of readers: it holds the newest value, no queue.

The writer stores a sequence number before and after the value. A reader that finds the two
different, or finds them changed meanwhile, keeps its previous value. Mailboxes carry requests of
people to the loop, and the values of every slow device to and from the loop. A mailbox holds a
level, not an event: a value stays until the next post.
"""

import mmap
import os
from typing import Any, NamedTuple

from controllers.signals import Index, Second
from rig.recording.row_layout import layout, leaves, packer

_SLOT = mmap.PAGESIZE


class Request(NamedTuple):
    """A request of people or the supervisor to the loop, repeatedly posted as a heartbeat."""

    request: Index  # rig.realtime.safety.REQUEST_*
    heartbeat: Second  # CLOCK_MONOTONIC when the supervisor posted it


def create() -> int:
    """Create the shared memory of one slot and return its file descriptor (inheritable)."""
    fd = os.memfd_create("wec-rig-mailbox", 0)
    os.ftruncate(fd, _SLOT)
    return fd


class Mailbox:
    """One end of a slot that holds values of ``message_type``, a NamedTuple of floats and ints."""

    def __init__(self, fd: int, message_type: type) -> None:
        self._map = mmap.mmap(fd, _SLOT)
        self._layout = layout(message_type)
        self._pack = packer(message_type)
        self._type = message_type
        if any(len(leaf.path) > 1 for leaf in leaves(message_type)):
            raise TypeError(f"{message_type.__name__} is nested; a mailbox holds one flat message")
        if 16 + self._layout.size > _SLOT:
            raise ValueError(f"{message_type.__name__} does not fit in a mailbox")
        self._sequence = memoryview(self._map).cast("q")
        self._last: Any = None
        self._read = 0  # sequence number of the value in _last

    def post(self, value: Any) -> None:
        """Replace the value."""
        sequence = self._sequence[1] + 1
        self._sequence[0] = sequence
        self._pack(self._map, 16, value)
        self._sequence[1] = sequence

    def read(self) -> Any:
        """Return the newest complete value, or None before the first post."""
        before = self._sequence[1]
        if before == self._read:
            return self._last
        value = self._layout.unpack_from(self._map, 16)
        if self._sequence[0] == before == self._sequence[1]:
            self._last = self._type(*value)
            self._read = before
        return self._last
