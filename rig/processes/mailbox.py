"""A shared slot with one writer and any number of readers: it holds the newest value, no queue.

The writer stores a sequence number before and after the value. A reader that finds the two
different, or finds them changed meanwhile, keeps its previous value. Mailboxes carry requests of
people to the loop, and the values of every slow device to and from the loop. A mailbox holds a
level, not an event: a value stays until the next post.
"""

import mmap
import os
from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

from controllers.signals import Count, Flag, Index, Second
from rig.realtime.requests import NO_REQUEST, Request
from rig.recording.row_layout import layout, leaves, packer

_SLOT = mmap.PAGESIZE


class SupervisorMessage(NamedTuple):
    """The requests to the loop, repeatedly posted as a heartbeat."""

    heartbeat: Second  # CLOCK_MONOTONIC when the supervisor posted it
    code: Index = 0  # this and all that follow as of `rig.realtime.requests.Request`
    armed: Flag = 0
    live: Count = 0
    jump: Count = 0
    segment: Index = 0

    @property
    def request(self) -> Request:
        """The requests without the heartbeat."""
        return Request(*self[1:])


def live_setpoint_type(columns: Sequence[float]) -> Any:
    """Return the type of the message with a set point that people chose.

    ``columns``: numbers of any set point, for their types.
    """
    fields: list[tuple[str, Any]] = [("number", Count)]
    for i, each in enumerate(columns):
        fields.append((f"column_{i}", Index if isinstance(each, int) else Annotated[float, "1"]))
    return NamedTuple("LiveSetpoint", fields)


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


class LoopMailbox:
    """The loop's end of the supervisor's mailboxes: requests, and set points that people chose."""

    def __init__(self, fd: int, live_fd: int, columns: Sequence[float]) -> None:
        """``live_fd``: of the set points, whose numbers have the types of ``columns``; -1: none."""
        self._requests = Mailbox(fd, SupervisorMessage)
        self._live = Mailbox(live_fd, live_setpoint_type(columns)) if live_fd >= 0 else None
        self._message: SupervisorMessage | None = None
        self._request = NO_REQUEST

    def read(self) -> Request:
        """Return the requests in force."""
        message = self._requests.read()
        if message is not self._message:
            self._message, self._request = message, message.request
        return self._request

    def live_numbers(self, number: int) -> Sequence[float] | None:
        """Return the numbers of the set point with a number; None if it is not there (yet)."""
        message = self._live.read() if self._live else None
        return message[1:] if message is not None and message.number == number else None

    def heartbeat(self) -> float | None:
        """Return when the supervisor posted last, CLOCK_MONOTONIC (s); None before the first."""
        message = self._requests.read()
        return None if message is None else message.heartbeat
