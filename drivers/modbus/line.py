"""One Modbus line: sequential requests, each of which returns an answer or raises `LineError`.

RTU frames carry no transaction number: after one late answer every later request would receive the
answer to the request before it, for ever (measured with pymodbus 3.16). So after a timeout an RTU
line waits for longer than its slowest device needs, discards the received bytes, and accepts the
next answer only if its length differs from that of the missing answer. A lost line is opened again
after a pause that doubles; until then its requests fail at once.
"""

import logging
import termios
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ModbusException, ModbusIOException

from drivers.errors import LinkError
from drivers.modbus.registers import BIT_TABLES, RegisterBlock

# This module raises every error; the library would log it a second time.
logging.getLogger("pymodbus").setLevel(logging.CRITICAL)

_PORT_ERRORS = (OSError, termios.error)  # raised by a port that no longer exists
EXCEPTION_TEXTS = {  # Modbus application protocol V1.1b3, section 7
    1: "illegal function",
    2: "illegal address",
    3: "illegal value",
    4: "device failure",
    5: "acknowledge: it needs more time",
    6: "busy",
    8: "memory parity error",
    10: "gateway has no path",
    11: "gateway got no answer",
}
VENDOR_SPECIFIC = "of the device's maker"
_TEMPORARY = (5, 6)
MIN_PAUSE, MAX_PAUSE = 0.1, 5.0  # s between attempts to open a line


class TcpSettings(NamedTuple):
    """A Modbus/TCP server."""

    host: str
    port: int
    timeout: float  # s for one answer, > 0


class RtuSettings(NamedTuple):
    """A serial line with Modbus RTU units on it."""

    port: str
    baud: int
    parity: str  # N, E or O
    stop_bits: int
    timeout: float  # s for one answer, > 0
    max_response_time: float  # s, upper bound of the slowest unit's response time


class LineError(LinkError):
    """A request without a valid answer; names line, unit and address."""


class NoAnswerError(LineError):
    """No answer within the timeout."""


class ExceptionResponseError(LineError):
    """The unit answered with an exception; `code` is its number."""

    def __init__(self, message: str, code: int) -> None:
        super().__init__(message)
        self.code = code

    @property
    def is_temporary(self) -> bool:
        """Return True when the unit works but asks for the request to be repeated later."""
        return self.code in _TEMPORARY


class ClosedLineError(LineError):
    """The line is not open: device removed, connection refused, port in use."""


class Line:
    """The client end of a line; one thread uses it."""

    def __init__(
        self,
        settings: TcpSettings | RtuSettings,
        writable: Sequence[RegisterBlock] = (),
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """Store the settings; ``writable``: the only registers that `write` accepts."""
        self.name = f"{settings.host}:{settings.port}" if isinstance(settings, TcpSettings) else (
            settings.port
        )  # fmt: skip
        self.timeouts = self.open_count = 0
        self._rtu = settings if isinstance(settings, RtuSettings) else None
        self._writable = frozenset(
            (block.unit, block.table, block.first + i)
            for block in writable
            for i in range(block.size)
        )
        self._clock, self._sleep = clock, sleep
        self._client: Any = (
            ModbusTcpClient(settings.host, port=settings.port, timeout=settings.timeout, retries=0)
            if isinstance(settings, TcpSettings)
            else ModbusSerialClient(
                settings.port,
                baudrate=settings.baud,
                parity=settings.parity,
                stopbits=settings.stop_bits,
                timeout=settings.timeout,
                retries=0,
            )
        )
        self._open = False
        self._pause, self._not_before = MIN_PAUSE, clock()
        self._late_size = 0  # registers or bits of an answer that may still arrive

    def read(self, block: RegisterBlock) -> list[int]:
        """Return the registers of a block (bits as 0 and 1); LineError on any failure.

        The answer always has the requested size; another size is an error.
        """
        where = f"{self.name}: unit {block.unit}, {block.table} {block.first}"
        if self._late_size and block.size == self._late_size:
            self._send_probe(block, where)
        answer = self._request(
            where, block.size, _READS[block.table], block.first, count=block.size, unit=block.unit
        )
        values = answer.bits if block.table in BIT_TABLES else answer.registers
        expected = -(-block.size // 8) * 8 if block.table in BIT_TABLES else block.size
        if len(values) != expected:
            self._discard_late_answer(len(values))  # not ours: the late answer to a request before
            raise NoAnswerError(f"{where}: answer has {len(values)} values, not {expected}")
        self._late_size = 0
        return [int(value) for value in values[: block.size]]

    def write(self, block: RegisterBlock, registers: Sequence[int]) -> None:
        """Write a whole block; ValueError if it is not listed as writable, LineError as `read`."""
        where = f"{self.name}: unit {block.unit}, {block.table} {block.first}"
        for i in range(len(registers)):
            if (block.unit, block.table, block.first + i) not in self._writable:
                raise ValueError(f"{where}: register {block.first + i} is not listed as writable")
        coils = block.table == "coil"
        call = "write_coils" if coils else "write_registers"
        values = [bool(value) for value in registers] if coils else list(registers)
        answer = self._request(where, 0, call, block.first, values, unit=block.unit)
        echo = (answer.function_code, answer.address, getattr(answer, "count", -1))
        if echo != (_WRITES[block.table], block.first, len(registers)):
            self._discard_late_answer(0)  # not ours: the late answer to a request before
            raise NoAnswerError(f"{where}: answer to another request")

    def close(self) -> None:
        """Close the line; cannot raise."""
        self._open = False
        try:
            self._client.close()
        except (ModbusException, *_PORT_ERRORS):
            return

    def _request(
        self, where: str, length: int, call: str, *args: Any, unit: int, **kwargs: Any
    ) -> Any:
        self._ensure_open(where)
        try:
            answer = getattr(self._client, call)(*args, device_id=unit, **kwargs)
        except ModbusIOException as error:
            self._discard_late_answer(length)
            raise NoAnswerError(f"{where}: {_short_text(error)}") from None
        except (ModbusException, *_PORT_ERRORS, ValueError, AttributeError) as error:
            self._close_lost()
            raise ClosedLineError(f"{where}: {error}") from None
        if answer.isError():
            code = int(getattr(answer, "exception_code", 0))
            name = EXCEPTION_TEXTS.get(code, VENDOR_SPECIFIC)
            raise ExceptionResponseError(f"{where}: refused with exception {code}, {name}", code)
        return answer

    def _ensure_open(self, where: str) -> None:
        if self._open:
            return
        if self._clock() < self._not_before:
            raise ClosedLineError(f"{where}: line is closed; it is opened again after a pause")
        try:
            self._open = bool(self._client.connect())
        except (ModbusException, *_PORT_ERRORS, ValueError) as error:
            self._close_lost()
            raise ClosedLineError(f"{where}: {error}") from None
        if not self._open:
            self._close_lost()
            raise ClosedLineError(f"{where}: cannot be opened")
        self.open_count += 1
        self._pause, self._late_size = MIN_PAUSE, 0

    def _close_lost(self) -> None:
        self.close()
        self._not_before = self._clock() + self._pause
        self._pause = min(2.0 * self._pause, MAX_PAUSE)

    def _send_probe(self, block: RegisterBlock, where: str) -> None:
        """Send a request with an answer of another length than that of the late answer."""
        step = 8 if block.table in BIT_TABLES else 1
        size = block.size - step if block.size > step else block.size + step
        probe = block._replace(size=size, values=())
        try:
            self.read(probe)
        except ExceptionResponseError:
            self._late_size = 0  # an exception frame has a length of its own

    def _discard_late_answer(self, missed: int) -> None:
        """After a missing answer: wait until a late one has arrived, and discard it.

        TCP has transaction numbers, so a late answer does no harm there; but pymodbus may or may
        not have closed the connection, and a new one is in a known state.
        """
        self.timeouts += 1
        self._late_size = missed
        if self._rtu is None:
            self._close_lost()
            return
        self._sleep(self._rtu.max_response_time)
        port = self._client.socket
        if port is not None:
            try:
                port.reset_input_buffer()
            except _PORT_ERRORS:
                self._close_lost()


def _short_text(error: Exception) -> str:
    """Return the library's message, without its text about retries (there are none here)."""
    text = str(error)
    return "no answer" if "No response" in text else text


_WRITES = {"coil": 15, "holding": 16}  # function codes
_READS = {
    "coil": "read_coils",
    "discrete": "read_discrete_inputs",
    "input": "read_input_registers",
    "holding": "read_holding_registers",
}
