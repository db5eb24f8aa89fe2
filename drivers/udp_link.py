"""A connected UDP socket: non-blocking reads of datagrams, and a count of the dropped ones.

The socket is connected, so the kernel rejects datagrams of other hosts and reports a peer whose
port is closed. Such a refusal does not close the socket: the peer may be starting.
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

MIN_PAUSE, MAX_PAUSE = 0.1, 5.0  # s between attempts to open
MAX_DATAGRAMS = 256  # datagrams per call of `receive`; further ones wait for the next call
_LARGEST = 2048  # bytes; an Ethernet frame holds less
_RXQ_OVFL = 40  # Linux, SO_RXQ_OVFL: number of datagrams dropped because the buffer was full
_COUNT = struct.Struct("I")
_CONTROL_SIZE = socket.CMSG_SPACE(_COUNT.size)


class UdpSettings(NamedTuple):
    """One peer."""

    device: str  # name of the device, for people
    host: str  # numeric address: resolving a name could block
    port: int
    receive_buffer: int = 1 << 20  # bytes requested from the kernel, which may grant less


class UdpLink:
    """One end of a UDP connection for one thread; counts and reports errors, does not raise."""

    def __init__(
        self, settings: UdpSettings, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Leave the socket closed: `receive` opens it, or `open`, which raises on failure."""
        self.open_count = self.loss_count = 0
        self.received = self.sent = 0  # bytes
        self.unsent = 0  # datagrams that were not sent
        self.refused = 0  # times that the peer's host reported its port closed
        self.dropped = 0  # datagrams that the kernel dropped because the buffer was full
        self.buffer = 0  # bytes of receive buffer that the kernel granted
        self.problem = "not opened yet"  # why it is closed, for people; empty while it is open
        self.name = f"{settings.device} at {settings.host}:{settings.port}"
        self._settings = settings
        self._clock = clock
        self._back_off = BackOff(MIN_PAUSE, MAX_PAUSE)
        self._socket: socket.socket | None = None
        self._dropped_before = 0

    def now(self) -> float:
        """Return the time of the monotonic clock, s."""
        return self._clock()

    @property
    def is_open(self) -> bool:
        """Return True while the socket is open, whether or not the peer answers."""
        return self._socket is not None

    def open(self) -> None:
        """Open the socket now; raise LinkError with device, address and reason on failure."""
        if self._socket is not None:
            return
        new_socket: socket.socket | None = None
        try:
            family = ipaddress.ip_address(self._settings.host).version
            new_socket = socket.socket(
                socket.AF_INET if family == 4 else socket.AF_INET6, socket.SOCK_DGRAM
            )
            new_socket.setblocking(False)
            new_socket.setsockopt(
                socket.SOL_SOCKET, socket.SO_RCVBUF, self._settings.receive_buffer
            )
            with suppress(OSError):
                new_socket.setsockopt(socket.SOL_SOCKET, _RXQ_OVFL, 1)
            new_socket.connect((self._settings.host, self._settings.port))
            self.buffer = new_socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
        except (OSError, ValueError, OverflowError) as error:
            if new_socket is not None:
                new_socket.close()
            self._back_off.record_failure(self._clock())
            self.problem = str(error)
            raise LinkError(f"{self.name}: {error}") from error
        self._socket, self._dropped_before = new_socket, self.dropped
        self.open_count, self.problem = self.open_count + 1, ""

    def receive(self) -> list[bytes]:
        """Return the datagrams received since the last call, in order; never wait.

        A closed socket is opened here once its pause has passed.
        """
        if self._socket is None:
            if self._back_off.ready(self._clock()):
                with suppress(LinkError):
                    self.open()
            return []
        datagrams: list[bytes] = []
        for _ in range(MAX_DATAGRAMS):
            try:
                data, control_messages, _, _ = self._socket.recvmsg(_LARGEST, _CONTROL_SIZE)
            except BlockingIOError:
                break
            except ConnectionRefusedError:
                self.refused += 1
                continue
            except OSError as error:
                self._close_lost(str(error.strerror))
                break
            for level, kind, value in control_messages:
                if (level, kind) == (socket.SOL_SOCKET, _RXQ_OVFL):
                    self.dropped = self._dropped_before + _COUNT.unpack(value[: _COUNT.size])[0]
            self.received += len(data)
            datagrams.append(data)
        if datagrams:
            self._back_off.record_success()
        return datagrams

    def send(self, data: bytes) -> bool:
        """Send one datagram without waiting; return False if it was not sent."""
        if self._socket is None:
            self.unsent += 1
            return False
        try:
            self._socket.send(data)
        except BlockingIOError:
            self.unsent += 1
            return False
        except ConnectionRefusedError:  # caused by an earlier datagram; this one was not sent
            self.refused, self.unsent = self.refused + 1, self.unsent + 1
            return False
        except OSError as error:
            self.unsent += 1
            self._close_lost(str(error.strerror))
            return False
        self.sent += len(data)
        return True

    def close(self) -> None:
        """Close the socket; cannot raise. A later `receive` opens it again."""
        old_socket, self._socket = self._socket, None
        if old_socket is not None:
            self.problem = "closed"
            with suppress(OSError):
                old_socket.close()

    def _close_lost(self, reason: str) -> None:
        self.loss_count += 1
        self.close()
        self.problem = reason
        self._back_off.record_failure(self._clock())
