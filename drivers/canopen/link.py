"""The CAN bus as raw frames: python-can opened once, sent to and emptied without ever waiting.

Any interface of python-can will do by its name. Our own frames are kept out by the COB-IDs that are
wanted: not every interface marks what it sends back, and a kernel marks the frames of every other
process on this host as if they were our own.
"""

import logging
import time
from collections.abc import Iterable
from typing import Any, NamedTuple

import can

from drivers import errors
from drivers.canopen.bus_off import BUS_OFF
from drivers.canopen.bus_settings import Bus
from drivers.canopen.socketcand_bus import SocketcandBus

# Half a message in a read of a socket is no news, and 1000 lines a second would be no log.
logging.getLogger("can").setLevel(logging.ERROR)

# Whose kernel keeps out what is not wanted. With python-can's own filters a look at the bus ends at
# the first unwanted frame, and what lies behind it comes a look later.
_FILTERING = ("socketcan",)
_GONE = (can.CanError, OSError, ValueError, LookupError)  # also text of slcan that is no frame


class Frame(NamedTuple):
    """One frame as it came."""

    cob_id: int
    data: bytes


class LinkError(errors.LinkError):
    """The bus cannot be opened, or is gone; names interface and channel."""


def open_bus(bus: Bus, wanted: Iterable[int] = ()) -> can.BusABC:
    """Open the bus, if it can filter for these COB-IDs (none: all); LinkError says why not."""
    filters: Any = None
    if bus.interface in _FILTERING:
        filters = [{"can_id": i, "can_mask": 0x7FF, "extended": False} for i in sorted(wanted)]
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
    except (NameError, AttributeError) as error:  # python-can without the maker's own library
        raise LinkError(
            f"CAN bus {bus.interface} {bus.channel}: the library of its maker is not installed "
            f"({error})"
        ) from error
    except (can.CanError, OSError, ValueError, TypeError, ImportError) as error:
        raise LinkError(f"CAN bus {bus.interface} {bus.channel}: {error}") from error


def hear_only(bus: can.BusABC, cob_ids: Iterable[int]) -> None:
    """Let frames with these COB-IDs through from now on, and the error frame of bus-off."""
    wanted: list[Any] = [{"can_id": i, "can_mask": 0x7FF, "extended": False} for i in cob_ids]
    bus.set_filters([*wanted, {"can_id": BUS_OFF, "can_mask": 0x7FF}])


class Link:
    """One end of a bus for one thread; what goes wrong is counted, not raised, once it is open."""

    def __init__(self, bus: Bus, wanted: Iterable[int]) -> None:
        """Open the bus for frames with the ``wanted`` COB-IDs; LinkError if it cannot be."""
        self.unsent = 0  # frames that the bus did not take
        self.errors = 0  # error frames, and failed looks at the bus
        self.behind = False  # the last look ended before the bus was empty
        self._wanted = frozenset(wanted)
        self._bus = open_bus(bus, self._wanted)
        self._said = time.monotonic  # the wire is a place where time may be read

    def now(self) -> float:
        """Seconds on the monotonic clock, by which frames are timed."""
        return self._said()

    def send(self, cob_id: int, data: bytes) -> bool:
        """Send a frame now or not at all; False if the bus did not take it."""
        message = can.Message(arbitration_id=cob_id, data=data, is_extended_id=False, check=False)
        try:
            self._bus.send(message)
        except _GONE:
            self.unsent += 1
            return False
        return True

    def drain(self, most: int = 64) -> list[Frame]:
        """What has come since the last call, oldest first, at most so many frames; never waits.

        A babbling node can thus take ``most`` frames' time of a tick and no more.
        """
        found = []
        self.behind = False
        try:
            for _ in range(most):
                message = self._bus.recv(0.0)
                if message is None:
                    break
                if message.is_error_frame:
                    self.errors += 1
                elif (
                    message.arbitration_id in self._wanted
                    and not message.is_extended_id
                    and not message.is_remote_frame
                ):
                    found.append(Frame(message.arbitration_id, bytes(message.data)))
            else:
                self.behind = True
        except _GONE:
            self.errors += 1
        return found

    def close(self) -> None:
        """Give the bus back; cannot raise."""
        try:
            self._bus.shutdown()
        except _GONE:
            self.errors += 1
