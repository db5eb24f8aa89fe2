"""A serial port: non-blocking reads, and one write per message.

A port that hangs up (adapter pulled, other end closed) is closed and opened again after a pause
that doubles. Opening exchanges data with the adapter and can take milliseconds, so these links run
in I/O processes, and the loop reads the values that they post.
"""

import errno
import os
import select
import termios
import time
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

import serial

from drivers import rs485_echo
from drivers.back_off import BackOff
from drivers.errors import LinkError

MIN_PAUSE, MAX_PAUSE = 0.1, 5.0  # s between attempts to open a port
MAX_BYTES = 65536  # bytes per call of `receive`; further bytes wait for the next call
_READ_SIZE = 4096  # bytes; a terminal returns no more from one read
_PTY_MAJORS = range(136, 144)  # device numbers of the pseudo-terminals of Linux
_HANG_UP_EVENTS = select.POLLHUP | select.POLLERR | select.POLLNVAL
_PORT_ERRORS = (OSError, ValueError, termios.error)  # SerialException is an OSError
_REASONS = {
    errno.ENOENT: "there is no such port",
    errno.EACCES: "no permission (is the user in the group of serial ports?)",
    errno.EAGAIN: "in use by another process",
    errno.EBUSY: "in use by another process",
}


class SerialSettings(NamedTuple):
    """One port. A path under /dev/serial/by-id stays with its adapter; ttyUSB0 does not."""

    device: str  # name of the connected device, for people
    port: str
    baud: int
    parity: str  # N, E or O
    stop_bits: int  # 1 or 2
    rts_cts: int = 0  # 1: hardware handshake
    echo: int = 0  # 1: a two-wire RS-485 adapter that receives its own transmission
    low_latency: int = 0  # 1: request that the adapter's driver passes bytes on at once


class SerialLink:
    """One end of a serial line for one thread; it counts and reports errors instead of raising."""

    def __init__(
        self, settings: SerialSettings, *, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """Leave the port closed: `receive` opens it, or `open`, which raises on failure."""
        self.open_count = self.loss_count = 0
        self.received = self.sent = 0  # bytes
        self.unsent = 0  # messages that were not sent completely
        self.problem = "not opened yet"  # why it is closed, for people; empty while it is open
        self.low_latency = "not asked for"  # result of the request, for people
        self.name = f"{settings.device} on {settings.port}"
        self._settings = settings
        self._clock = clock
        self._back_off = BackOff(MIN_PAUSE, MAX_PAUSE)
        self._port: serial.Serial | None = None
        self._fd = -1
        self._poll = select.poll()
        self._echo = rs485_echo.start()

    def now(self) -> float:
        """Return the time of the monotonic clock, s."""
        return self._clock()

    @property
    def is_open(self) -> bool:
        """Return True while the port is open, whether or not the device answers."""
        return self._port is not None

    @property
    def echoes_missed(self) -> int:
        """Return how often other bytes came instead of the expected echo."""
        return self._echo.missed_echoes

    def open(self) -> None:
        """Open the port now; raise LinkError with device, port and reason on failure."""
        if self._port is not None:
            return
        settings = self._settings
        try:
            opened = serial.Serial(
                settings.port,
                baudrate=settings.baud,
                parity=settings.parity,
                stopbits=settings.stop_bits,
                rtscts=settings.rts_cts == 1,
                timeout=0,
                write_timeout=0,
                exclusive=True,
            )
        except _PORT_ERRORS as error:
            self._back_off.record_failure(self._clock())
            reason = _REASONS.get(getattr(error, "errno", None) or 0, str(error))
            self.problem = reason
            raise LinkError(f"{self.name}: {reason}") from error
        self._port, self._fd = opened, opened.fileno()
        self._poll = select.poll()
        self._poll.register(self._fd, select.POLLIN)
        self._echo = rs485_echo.start()._replace(missed_echoes=self._echo.missed_echoes)
        self.open_count, self.problem = self.open_count + 1, ""
        self.low_latency = self._set_low_latency(opened)

    def receive(self) -> list[bytes]:
        """Return the bytes received since the last call, as one piece or none; never wait.

        A closed port is opened here once its pause has passed; that call returns no bytes.
        """
        if self._port is None:
            if self._back_off.ready(self._clock()):
                with suppress(LinkError):
                    self.open()
            return []
        data = b""
        while len(data) < MAX_BYTES:
            try:
                events = self._poll.poll(0)
                if not events:
                    break
                piece = os.read(self._fd, _READ_SIZE)
            except BlockingIOError:
                if events[0][1] & _HANG_UP_EVENTS:
                    self._close_lost("hung up")
                break
            except OSError as error:
                self._close_lost(f"hung up ({error.strerror})")
                break
            if not piece:
                self._close_lost("hung up")
                break
            data += piece
        if not data:
            return []
        self.received += len(data)
        self._back_off.record_success()
        if self._settings.echo == 1:
            self._echo, data = rs485_echo.strip_echo(self._echo, data)
        return [data] if data else []

    def send(self, data: bytes) -> bool:
        """Send a message in one write; return False if the port did not accept all of it."""
        if self._port is None:
            self.unsent += 1
            return False
        try:
            written = os.write(self._fd, data)
        except BlockingIOError:
            written = 0
        except OSError as error:
            self._close_lost(f"hung up ({error.strerror})")
            written = 0
        self.sent += written
        if self._settings.echo == 1:
            self._echo = rs485_echo.record_sent(self._echo, data[:written])
        if written != len(data):
            self.unsent += 1
        return written == len(data)

    def close(self) -> None:
        """Close the port; cannot raise. A later `receive` opens it again."""
        port, self._port, self._fd = self._port, None, -1
        if port is None:
            return
        self.problem = "closed"
        with suppress(*_PORT_ERRORS):
            port.reset_output_buffer()  # otherwise closing waits for bytes that nobody reads
        with suppress(*_PORT_ERRORS):
            port.close()

    def _close_lost(self, reason: str) -> None:
        self.loss_count += 1
        self.close()
        self.problem = reason
        self._back_off.record_failure(self._clock())

    def _set_low_latency(self, port: serial.Serial) -> str:
        """Request low latency and return the result; a pseudo-terminal lacks it and would raise."""
        if self._settings.low_latency != 1:
            return "not asked for"
        if os.major(os.fstat(self._fd).st_rdev) in _PTY_MAJORS:
            return "not on a pseudo-terminal"
        try:
            port.set_low_latency_mode(True)
        except (*_PORT_ERRORS, NotImplementedError, AttributeError) as error:
            return f"refused: {error}"
        return "set"
