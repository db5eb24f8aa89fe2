"""One Modbus line: requests in turn, each answered, refused or timed out; nothing stays hidden.

RTU frames carry no transaction number: after one late answer every later request would be given
the answer before it, for ever (measured with pymodbus 3.16). So after a time-out an RTU line falls
quiet for longer than its slowest device answers, throws away what came, and believes the next
answer only if it is of another length than the one that was missed. A line that is gone is opened
again after a pause that doubles; meanwhile its requests fail at once.
"""

import logging
import termios
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from pymodbus.client import ModbusSerialClient, ModbusTcpClient
from pymodbus.exceptions import ModbusException, ModbusIOException

from drivers.errors import LinkError
from drivers.modbus.registers import BITS, Block

# What goes wrong is raised here, once; the library says it again for people.
logging.getLogger("pymodbus").setLevel(logging.CRITICAL)

_PULLED = (OSError, termios.error)  # what a port says that is no longer there
EXCEPTIONS = {  # Modbus application protocol V1.1b3, section 7
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
MAKERS_OWN = "of the device's maker"
_AGAIN = (5, 6)
PAUSE_FIRST, PAUSE_MOST = 0.1, 5.0  # s between attempts to open a line


class Tcp(NamedTuple):
    """A Modbus/TCP server."""

    host: str
    port: int
    timeout: float  # s for one answer, > 0


class Rtu(NamedTuple):
    """A serial line with Modbus RTU units on it."""

    port: str
    baud: int
    parity: str  # N, E or O
    stop_bits: int
    timeout: float  # s for one answer, > 0
    slowest: float  # s, in which the slowest unit has answered for certain


class LineError(LinkError):
    """A request without a good answer; names line, unit and address."""


class SilentError(LineError):
    """No answer in time."""


class RefusedError(LineError):
    """The unit answered with an exception; `code` is its number."""

    def __init__(self, said: str, code: int) -> None:
        super().__init__(said)
        self.code = code

    @property
    def passing(self) -> bool:
        """Whether the unit asks to be asked again: it is there and well, but not now."""
        return self.code in _AGAIN


class GoneError(LineError):
    """The line is not open: device gone, connection refused, port in use."""


class Line:
    """The one end of a line; one thread uses it."""

    def __init__(
        self,
        settings: Tcp | Rtu,
        writable: Sequence[Block] = (),
        *,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        """``writable``: the only registers that may ever be written."""
        self.name = f"{settings.host}:{settings.port}" if isinstance(settings, Tcp) else (
            settings.port
        )  # fmt: skip
        self.timeouts = self.opened = 0
        self._rtu = settings if isinstance(settings, Rtu) else None
        self._writable = frozenset(
            (block.unit, block.table, block.first + i)
            for block in writable
            for i in range(block.size)
        )
        self._clock, self._sleep = clock, sleep
        self._client: Any = (
            ModbusTcpClient(settings.host, port=settings.port, timeout=settings.timeout, retries=0)
            if isinstance(settings, Tcp)
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
        self._pause, self._not_before = PAUSE_FIRST, clock()
        self._missed = 0  # registers or bits that an answer still on its way may carry

    def read(self, block: Block) -> list[int]:
        """The registers (bits as 0 and 1) of a block; LineError says what went wrong.

        The answer is as long as asked for, or there is none.
        """
        what = f"{self.name}: unit {block.unit}, {block.table} {block.first}"
        if self._missed and block.size == self._missed:
            self._clear(block, what)
        answer = self._ask(
            what, block.size, _READS[block.table], block.first, count=block.size, unit=block.unit
        )
        found = answer.bits if block.table in BITS else answer.registers
        whole = -(-block.size // 8) * 8 if block.table in BITS else block.size
        if len(found) != whole:
            self._silent(len(found))  # not ours: the late answer to a request before
            raise SilentError(f"{what}: an answer of {len(found)}, not {whole}")
        self._missed = 0
        return [int(value) for value in found[: block.size]]

    def write(self, block: Block, registers: Sequence[int]) -> None:
        """Write a whole block; ValueError if it is not listed as writable, LineError as `read`."""
        what = f"{self.name}: unit {block.unit}, {block.table} {block.first}"
        for i in range(len(registers)):
            if (block.unit, block.table, block.first + i) not in self._writable:
                raise ValueError(f"{what}: register {block.first + i} is not listed as writable")
        coils = block.table == "coil"
        call = "write_coils" if coils else "write_registers"
        values = [bool(value) for value in registers] if coils else list(registers)
        answer = self._ask(what, 0, call, block.first, values, unit=block.unit)
        echo = (answer.function_code, answer.address, getattr(answer, "count", -1))
        if echo != (_WRITES[block.table], block.first, len(registers)):
            self._silent(0)  # not ours: the late answer to a request before
            raise SilentError(f"{what}: an answer to something else")

    def close(self) -> None:
        """Give the line back; cannot raise."""
        self._open = False
        try:
            self._client.close()
        except (ModbusException, *_PULLED):
            return

    def _ask(self, what: str, length: int, call: str, *args: Any, unit: int, **kwargs: Any) -> Any:
        self._ready(what)
        try:
            answer = getattr(self._client, call)(*args, device_id=unit, **kwargs)
        except ModbusIOException as error:
            self._silent(length)
            raise SilentError(f"{what}: {_short(error)}") from None
        except (ModbusException, *_PULLED, ValueError, AttributeError) as error:
            self._lose()
            raise GoneError(f"{what}: {error}") from None
        if answer.isError():
            code = int(getattr(answer, "exception_code", 0))
            name = EXCEPTIONS.get(code, MAKERS_OWN)
            raise RefusedError(f"{what}: refused with exception {code}, {name}", code)
        return answer

    def _ready(self, what: str) -> None:
        if self._open:
            return
        if self._clock() < self._not_before:
            raise GoneError(f"{what}: not open, tried again in a moment")
        try:
            self._open = bool(self._client.connect())
        except (ModbusException, *_PULLED, ValueError) as error:
            self._lose()
            raise GoneError(f"{what}: {error}") from None
        if not self._open:
            self._lose()
            raise GoneError(f"{what}: cannot be opened")
        self.opened += 1
        self._pause, self._missed = PAUSE_FIRST, 0

    def _lose(self) -> None:
        self.close()
        self._not_before = self._clock() + self._pause
        self._pause = min(2.0 * self._pause, PAUSE_MOST)

    def _clear(self, block: Block, what: str) -> None:
        """Before a request whose answer could be mistaken: one that cannot, of another length."""
        step = 8 if block.table in BITS else 1
        size = block.size - step if block.size > step else block.size + step
        probe = block._replace(size=size, values=())
        try:
            self.read(probe)
        except RefusedError:
            self._missed = 0  # an exception frame is an answer of its own length

    def _silent(self, missed: int) -> None:
        """No good answer came: let what is on its way arrive, and throw it away.

        TCP has transaction numbers, so there nothing can be mistaken; but pymodbus may have closed
        the connection or not, and a fresh one is known.
        """
        self.timeouts += 1
        self._missed = missed
        if self._rtu is None:
            self._lose()
            return
        self._sleep(self._rtu.slowest)
        port = self._client.socket
        if port is not None:
            try:
                port.reset_input_buffer()
            except _PULLED:
                self._lose()


def _short(error: Exception) -> str:
    """What the library says, without its retries, which are none here."""
    said = str(error)
    return "no answer" if "No response" in said else said


_WRITES = {"coil": 15, "holding": 16}  # function codes
_READS = {
    "coil": "read_coils",
    "discrete": "read_discrete_inputs",
    "input": "read_input_registers",
    "holding": "read_holding_registers",
}
