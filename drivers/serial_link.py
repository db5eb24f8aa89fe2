"""A serial port as bytes: what has come is taken without waiting, what goes out is one write.

A port that hangs up (adapter pulled, other end gone) is closed and opened again after a pause that
doubles. Opening talks to the adapter and can take milliseconds: these links live beside the loop,
and the loop reads the values they post.
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

PAUSE_FIRST, PAUSE_MOST = 0.1, 5.0  # s between attempts to open a port
MOST = 65536  # bytes in one look; what is beyond waits for the next
_PIECE = 4096  # bytes a terminal gives at once, at most
_PTY_MAJORS = range(136, 144)  # device numbers of the pseudo-terminals of Linux
_GONE = select.POLLHUP | select.POLLERR | select.POLLNVAL
_TROUBLE = (OSError, ValueError, termios.error)  # SerialException is an OSError
_WHY = {
    errno.ENOENT: "there is no such port",
    errno.EACCES: "no permission (is the user in the group of serial ports?)",
    errno.EAGAIN: "in use by another process",
    errno.EBUSY: "in use by another process",
}


class Settings(NamedTuple):
    """One port. A path under /dev/serial/by-id stays with its adapter; ttyUSB0 does not."""

    device: str  # what is on it, for people
    port: str
    baud: int
    parity: str  # N, E or O
    stop_bits: int  # 1 or 2
    rts_cts: int = 0  # 1: hardware handshake
    echo: int = 0  # 1: a two-wire RS-485 adapter that hears itself
    low_latency: int = 0  # 1: ask the adapter's driver to hand on bytes at once


class SerialLink:
    """One end of a serial line for one thread; what goes wrong is counted and named, not raised."""

    def __init__(self, settings: Settings, *, clock: Callable[[], float] = time.monotonic) -> None:
        """Nothing is opened yet: `take` does that, or `open`, which says why not."""
        self.opens = self.losses = 0
        self.received = self.sent = 0  # bytes
        self.unsent = 0  # messages that did not go out whole
        self.trouble = "not opened yet"  # why it is closed, for people; empty while it is open
        self.low_latency = "not asked for"  # what became of it, for people
        self.name = f"{settings.device} on {settings.port}"
        self._settings = settings
        self._clock = clock
        self._back_off = BackOff(PAUSE_FIRST, PAUSE_MOST)
        self._port: serial.Serial | None = None
        self._fd = -1
        self._poll = select.poll()
        self._echo = rs485_echo.start()

    def now(self) -> float:
        """Seconds on the monotonic clock."""
        return self._clock()

    @property
    def is_open(self) -> bool:
        """Whether the port is open; not whether anybody answers."""
        return self._port is not None

    @property
    def echoes_missed(self) -> int:
        """Times that something else came where the echo of what was sent should have."""
        return self._echo.missed

    def open(self) -> None:
        """Open the port now; LinkError names device, port and why it cannot be."""
        if self._port is not None:
            return
        _, port, baud, parity, stop_bits, rts_cts, _, _ = self._settings
        try:
            opened = serial.Serial(
                port,
                baudrate=baud,
                parity=parity,
                stopbits=stop_bits,
                rtscts=rts_cts == 1,
                timeout=0,
                write_timeout=0,
                exclusive=True,
            )
        except _TROUBLE as error:
            self._back_off.failed(self._clock())
            why = _WHY.get(getattr(error, "errno", None) or 0, str(error))
            self.trouble = why
            raise LinkError(f"{self.name}: {why}") from error
        self._port, self._fd = opened, opened.fileno()
        self._poll = select.poll()
        self._poll.register(self._fd, select.POLLIN)
        self._echo = rs485_echo.start()._replace(missed=self._echo.missed)
        self.opens, self.trouble = self.opens + 1, ""
        self.low_latency = self._quicken(opened)

    def take(self) -> list[bytes]:
        """What has come since the last call, as one piece or none; never waits.

        A port that is closed is opened here when its time has come; nothing is taken that turn.
        """
        if self._port is None:
            if self._back_off.ready(self._clock()):
                with suppress(LinkError):
                    self.open()
            return []
        data = b""
        while len(data) < MOST:
            try:
                events = self._poll.poll(0)
                if not events:
                    break
                piece = os.read(self._fd, _PIECE)
            except BlockingIOError:
                if events[0][1] & _GONE:
                    self._lose("hung up")
                break
            except OSError as error:
                self._lose(f"hung up ({error.strerror})")
                break
            if not piece:
                self._lose("hung up")
                break
            data += piece
        if not data:
            return []
        self.received += len(data)
        self._back_off.worked()
        if self._settings.echo == 1:
            self._echo, data = rs485_echo.strip(self._echo, data)
        return [data] if data else []

    def send(self, data: bytes) -> bool:
        """Send a message in one write, whole or not; False if it was not taken whole."""
        if self._port is None:
            self.unsent += 1
            return False
        try:
            written = os.write(self._fd, data)
        except BlockingIOError:
            written = 0
        except OSError as error:
            self._lose(f"hung up ({error.strerror})")
            written = 0
        self.sent += written
        if self._settings.echo == 1:
            self._echo = rs485_echo.sent(self._echo, data[:written])
        if written != len(data):
            self.unsent += 1
        return written == len(data)

    def close(self) -> None:
        """Give the port back; cannot raise. `take` would open it again."""
        port, self._port, self._fd = self._port, None, -1
        if port is None:
            return
        self.trouble = "closed"
        with suppress(*_TROUBLE):
            port.reset_output_buffer()  # or closing waits for bytes that nobody fetches
        with suppress(*_TROUBLE):
            port.close()

    def _lose(self, why: str) -> None:
        self.losses += 1
        self.close()
        self.trouble = why
        self._back_off.failed(self._clock())

    def _quicken(self, port: serial.Serial) -> str:
        """Low latency where it can be; a pseudo-terminal has none and would raise."""
        if self._settings.low_latency != 1:
            return "not asked for"
        if os.major(os.fstat(self._fd).st_rdev) in _PTY_MAJORS:
            return "not on a pseudo-terminal"
        try:
            port.set_low_latency_mode(True)
        except (*_TROUBLE, NotImplementedError, AttributeError) as error:
            return f"refused: {error}"
        return "set"
