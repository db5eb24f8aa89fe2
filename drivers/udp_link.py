"""A UDP peer as datagrams: what has come is taken without waiting, lost ones are counted.

The socket is connected, so datagrams of other hosts never come in, and a peer whose port is closed
is noticed. A refusal closes nothing: the peer may be starting.
"""

import ipaddress
import socket
import struct
import time
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

from drivers.back_off import BackOff
from drivers.errors import LinkError

PAUSE_FIRST, PAUSE_MOST = 0.1, 5.0  # s between attempts to open
MOST = 256  # datagrams in one look; what is beyond waits for the next
_LARGEST = 2048  # bytes; an Ethernet frame holds less
_RXQ_OVFL = 40  # Linux, SO_RXQ_OVFL: datagrams dropped for want of buffer come as a number
_COUNT = struct.Struct("I")
_ROOM = socket.CMSG_SPACE(_COUNT.size)


class Settings(NamedTuple):
    """One peer."""

    device: str  # what it is, for people
    host: str  # its address in numbers: a name could make opening wait
    port: int
    receive_buffer: int = 1 << 20  # bytes asked of the kernel, which may grant less


class UdpLink:
    """One end for one thread; what goes wrong is counted and named, not raised."""

    def __init__(self, settings: Settings, *, clock: Callable[[], float] = time.monotonic) -> None:
        """Nothing is opened yet: `take` does that, or `open`, which says why not."""
        self.opens = self.losses = 0
        self.received = self.sent = 0  # bytes
        self.unsent = 0  # datagrams that did not go out
        self.refused = 0  # times the peer's host said that nobody listens
        self.dropped = 0  # datagrams that came and found the buffer full
        self.buffer = 0  # bytes of receive buffer that the kernel granted
        self.trouble = "not opened yet"  # why it is closed, for people; empty while it is open
        self.name = f"{settings.device} at {settings.host}:{settings.port}"
        self._settings = settings
        self._clock = clock
        self._back_off = BackOff(PAUSE_FIRST, PAUSE_MOST)
        self._socket: socket.socket | None = None
        self._dropped_before = 0

    def now(self) -> float:
        """Seconds on the monotonic clock."""
        return self._clock()

    @property
    def is_open(self) -> bool:
        """Whether the socket is open; not whether anybody answers."""
        return self._socket is not None

    def open(self) -> None:
        """Open the socket now; LinkError names device, address and why it cannot be."""
        if self._socket is not None:
            return
        made: socket.socket | None = None
        try:
            family = ipaddress.ip_address(self._settings.host).version
            made = socket.socket(
                socket.AF_INET if family == 4 else socket.AF_INET6, socket.SOCK_DGRAM
            )
            made.setblocking(False)
            made.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, self._settings.receive_buffer)
            with suppress(OSError):
                made.setsockopt(socket.SOL_SOCKET, _RXQ_OVFL, 1)
            made.connect((self._settings.host, self._settings.port))
            self.buffer = made.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
        except (OSError, ValueError, OverflowError) as error:
            if made is not None:
                made.close()
            self._back_off.failed(self._clock())
            self.trouble = str(error)
            raise LinkError(f"{self.name}: {error}") from error
        self._socket, self._dropped_before = made, self.dropped
        self.opens, self.trouble = self.opens + 1, ""

    def take(self) -> list[bytes]:
        """The datagrams that have come since the last call, in order; never waits.

        A socket that is closed is opened here when its time has come.
        """
        if self._socket is None:
            if self._back_off.ready(self._clock()):
                with suppress(LinkError):
                    self.open()
            return []
        found: list[bytes] = []
        for _ in range(MOST):
            try:
                data, notes, _, _ = self._socket.recvmsg(_LARGEST, _ROOM)
            except BlockingIOError:
                break
            except ConnectionRefusedError:
                self.refused += 1
                continue
            except OSError as error:
                self._lose(str(error.strerror))
                break
            for level, kind, value in notes:
                if (level, kind) == (socket.SOL_SOCKET, _RXQ_OVFL):
                    self.dropped = self._dropped_before + _COUNT.unpack(value[: _COUNT.size])[0]
            self.received += len(data)
            found.append(data)
        if found:
            self._back_off.worked()
        return found

    def send(self, data: bytes) -> bool:
        """Send one datagram now or not at all; False if it was not taken."""
        if self._socket is None:
            self.unsent += 1
            return False
        try:
            self._socket.send(data)
        except BlockingIOError:
            self.unsent += 1
            return False
        except ConnectionRefusedError:  # of a datagram before this one, which did not go out
            self.refused, self.unsent = self.refused + 1, self.unsent + 1
            return False
        except OSError as error:
            self.unsent += 1
            self._lose(str(error.strerror))
            return False
        self.sent += len(data)
        return True

    def close(self) -> None:
        """Give the socket back; cannot raise. `take` would open it again."""
        gone, self._socket = self._socket, None
        if gone is not None:
            self.trouble = "closed"
            with suppress(OSError):
                gone.close()

    def _lose(self, why: str) -> None:
        self.losses += 1
        self.close()
        self.trouble = why
        self._back_off.failed(self._clock())
