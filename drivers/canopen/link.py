"""A CAN bus as raw frames: non-blocking send and receive through python-can.

Every interface of python-can works by its name. Filtering by COB-ID excludes our own frames: not
every interface marks the frames that it echoes, and the kernel marks those of every other process
on this host as our own.
"""

import logging
import time
from collections.abc import Iterable, Sequence
from typing import Any

import can

from drivers import errors
from drivers.canopen.bus_off import BUS_OFF
from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.frame_port import BUS_ERRORS, Frame, frame_port
from drivers.canopen.socketcand_bus import SocketcandBus

# python-can warns of every partial message in a socket read: up to 1000 lines a second.
logging.getLogger("can").setLevel(logging.ERROR)

# Interfaces whose kernel filters frames. python-can's own filters end a poll at the first frame
# that does not match, which delays the frames behind it by one poll.
_KERNEL_FILTERING = ("socketcan",)


class LinkError(errors.LinkError):
    """The bus cannot be opened, or was lost; names interface and channel."""


def open_bus(bus: BusSettings, cob_ids: Iterable[int] = ()) -> can.BusABC:
    """Return the open bus; LinkError if it cannot be opened.

    ``cob_ids``: identifiers for the kernel's filter, where the interface has one; none: all.
    """
    filters: Any = None
    if bus.interface in _KERNEL_FILTERING:
        filters = [{"can_id": i, "can_mask": 0x7FF, "extended": False} for i in sorted(cob_ids)]
    try:
        if bus.interface == "socketcand":
            return SocketcandBus(channel=bus.channel, **dict(bus.options))
        return can.Bus(
            interface=bus.interface,
            channel=bus.channel,
            bitrate=bus.bit_rate,
            can_filters=filters or None,
            receive_own_messages=False,
            **dict(bus.options),
        )
    except (NameError, AttributeError) as error:  # python-can without the manufacturer's library
        raise LinkError(
            f"CAN bus {bus.interface} {bus.channel}: its manufacturer's library is not installed "
            f"({error})"
        ) from error
    except (can.CanError, OSError, ValueError, TypeError, ImportError) as error:
        raise LinkError(f"CAN bus {bus.interface} {bus.channel}: {error}") from error


def set_receive_filter(bus: can.BusABC, cob_ids: Iterable[int]) -> None:
    """Accept only frames with these COB-IDs from now on, and the error frame of bus-off."""
    filters: list[Any] = [{"can_id": i, "can_mask": 0x7FF, "extended": False} for i in cob_ids]
    bus.set_filters([*filters, {"can_id": BUS_OFF, "can_mask": 0x7FF}])


class Link:
    """One end of a bus for one thread; once open, it counts errors instead of raising them."""

    def __init__(self, bus: BusSettings, cob_ids: Iterable[int]) -> None:
        """Open the bus for frames with these COB-IDs; LinkError on failure."""
        self.unsent = 0  # frames that the bus did not accept
        self.errors = 0  # error frames, and failed polls
        self.has_backlog = False  # True: the last `drain` ended before the bus was empty
        cob_ids = frozenset(cob_ids)
        self._bus = open_bus(bus, cob_ids)
        self._port = frame_port(self._bus, cob_ids)
        self._clock = time.monotonic  # the wire is a place where time may be read

    def now(self) -> float:
        """Return the time of the monotonic clock (s), by which frames are timed."""
        return self._clock()

    def send(self, frames: Sequence[tuple[int, bytes]]) -> Sequence[int]:
        """Send frames (COB-ID, data) in their order, without waiting.

        Return the indices of those that the bus did not accept.
        """
        try:
            refused = self._port.send(frames)
        except BUS_ERRORS:
            refused = range(len(frames))
        self.unsent += len(refused)
        return refused

    def drain(self, max_frames: int = 64) -> list[Frame]:
        """Return the frames received since the last call, oldest first; never wait.

        ``max_frames`` bounds the time that a babbling node can take from a tick.
        """
        frames: list[Frame] = []
        self.has_backlog = False
        try:
            error_frames, self.has_backlog = self._port.receive(frames, max_frames)
            self.errors += error_frames
        except BUS_ERRORS:
            self.errors += 1
        return frames

    def close(self) -> None:
        """Close the bus; cannot raise."""
        try:
            self._bus.shutdown()
        except BUS_ERRORS:
            self.errors += 1
