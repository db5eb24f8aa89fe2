"""Set-up and service of a segment outside the tick: identities, objects, states, emergencies.

pysoem (an optional dependency) finds the slaves, writes objects over their mailboxes, maps the
process data and changes states. It shares the interface with the tick, so it hears the answers to
its own frames only, and never waits in the kernel.
"""

import fcntl
import os
import socket
import struct
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from enum import IntEnum
from functools import partial
from types import ModuleType
from typing import Any, NamedTuple, TypeVar

from drivers.cia402 import arming
from drivers.cia402.arming import Mismatch, SetupStep
from drivers.cia402.process_data import from_bytes, to_bytes
from drivers.errors import LinkError
from drivers.ethercat.link import filter_indices
from drivers.ethercat.process_image import Area

SERVICE_INDICES = range(16)  # pysoem uses no others
_FMMU, _FMMU_SIZE, _FMMUS = 0x0600, 16, 4  # register, bytes, number of those that are used
_FMMU_LAYOUT = struct.Struct("<IHBB3xBB3x")
_WATCHDOG_DIVIDER, _WATCHDOG_TIME = 0x0400, 0x0420  # registers; ticks of 40 ns, and their number
_WATCHDOG_ROUNDING_MS = 0.2
_SYNC_MANAGER, _SYNC_MANAGERS = 0x0800, 4  # register of the first, number of those that are used
_DIRECTION_AND_MODE, _BUFFERED_OUTPUTS, _TRIGGERS_WATCHDOG = 0x0F, 0x04, 0x40  # of its control
_READ, _WRITE = 1, 2  # type of an FMMU: inputs, outputs
_GET_FLAGS, _SET_FLAGS, _PROMISCUOUS = 0x8913, 0x8914, 0x0100  # SIOCGIFFLAGS, SIOCSIFFLAGS
_FIRST_STATION = 0x1001  # as pysoem counts them
_FEATURES, _HAS_CLOCK = 0x0008, 0x04  # register and bit
_DIFFERENCE, _SIZE = 0x092C, 0x7FFF_FFFF  # register of a clock; bits without the sign
_ERROR = 0x10  # bit of a state: an error; of a request: it is acknowledged
_TIMEOUT_US = 4000
_STATE_TIMEOUT_US = 3_000_000
_ATTEMPTS, _READ_ATTEMPTS = 5, 3
_REQUEST_INTERVAL_S = 1.5  # s from a request of OP, which may be lost, to the next one

T = TypeVar("T")


class AlState(IntEnum):
    """States of a slave."""

    NONE = 0  # it does not answer
    INIT = 1
    PRE_OPERATIONAL = 2
    BOOT = 3
    SAFE_OPERATIONAL = 4
    OPERATIONAL = 8


class ServiceError(OSError):
    """A segment or slave that cannot be set up; names slave and reason."""


class SlaveIdentity(NamedTuple):
    """A slave as it reports itself."""

    vendor: int
    product: int
    revision: int
    name: str


class SlaveSetup(NamedTuple):
    """The set-up of one slave, in the order of the line."""

    name: str  # of the rig's, for people
    steps: tuple[SetupStep, ...]  # objects, written in PRE_OPERATIONAL
    watchdog_ms: float  # without process data for longer, its outputs fall; 0: as it is
    sync0_ns: int = 0  # cycle of its SYNC0; 0: without


class SlaveAreas(NamedTuple):
    """The places of a slave's process data; None for a direction that it lacks."""

    outputs: Area | None
    inputs: Area | None


class SlaveStatus(NamedTuple):
    """State of one slave."""

    state: int  # `AlState`
    error: int  # AL status code while bit 4 of the state is set, else 0
    code: int  # of its last emergency, 0: none or cleared
    register: int  # error register of that emergency
    emergencies: int


class Service:
    """The service end of one segment, for one thread."""

    def __init__(self, interface: str) -> None:
        """Open the interface; LinkError names what is missing."""
        self._pysoem = _pysoem()
        self._master = self._pysoem.Master()
        self._codes: dict[int, tuple[int, int, int]] = {}  # by slave: code, register, count
        self._asked: dict[int, float] = {}  # by slave: when it was asked for OP, s
        self._mute: set[Any] = set()  # slaves whose mailbox has not answered
        self._interface = interface
        self._flags = _interface_flags(interface)
        before = set(os.listdir("/proc/self/fd"))
        try:
            self._master.open(interface)
        except ConnectionError as error:
            raise LinkError(f"EtherCAT on {interface}: {_open_problem(interface)}") from error
        new = {int(fd) for fd in set(os.listdir("/proc/self/fd")) - before}
        for descriptor in new:
            _restrict(descriptor)

    def find(self) -> tuple[SlaveIdentity, ...]:
        """Bring all slaves to PRE_OPERATIONAL and return who they are, in the order of the line."""
        if not any(self._master.config_init() > 0 for _ in range(_ATTEMPTS)):
            raise ServiceError(f"EtherCAT on {self._interface}: no slave answers")
        return tuple(
            SlaveIdentity(each.man, each.id, each.rev, each.name) for each in self._master.slaves
        )

    def configure(
        self, setups: Sequence[SlaveSetup], *, distributed: bool = False
    ) -> tuple[tuple[Mismatch, ...], ...]:
        """Write and read back the objects of each slave, and map the process data.

        ``distributed``: the clocks follow that of the first slave that has one. Return the
        mismatches of each slave. ServiceError names slaves whose mailbox fails, that do not reach
        SAFE_OPERATIONAL, or whose watchdog would not stop them.
        """
        found: list[tuple[Mismatch, ...]] = [()] * len(setups)
        problems: list[str] = []

        def set_up(position: int) -> Callable[..., None]:
            def work(*_: Any) -> None:
                setup, slave = setups[position], self._master.slaves[position]
                try:
                    found[position] = self._set_up(slave, setup)
                except Exception as error:  # noqa: BLE001 - pysoem swallows what a callback raises
                    problems.append(f"{setup.name}: {_text(error)}")

            return work

        for position in range(len(setups)):
            self._master.slaves[position].config_func = set_up(position)
        if distributed and not self._master.config_dc():
            raise ServiceError(f"EtherCAT on {self._interface}: no slave has a distributed clock")
        for attempt in range(_ATTEMPTS):
            problems.clear()
            try:
                self._master.config_map()
            except self._pysoem.ConfigMapError as error:
                problems += [_text(each) for each in error.error_list]
            if not problems or attempt == _ATTEMPTS - 1:
                break
        if problems:
            raise ServiceError("\n".join(problems))
        if self._master.state_check(AlState.SAFE_OPERATIONAL, _STATE_TIMEOUT_US) != (
            AlState.SAFE_OPERATIONAL
        ):
            names = [setup.name for setup in setups]
            raise ServiceError("\n".join(self.missing(names, AlState.SAFE_OPERATIONAL)))
        for position, setup in enumerate(setups):
            slave = self._master.slaves[position]
            slave.add_emergency_callback(self._note_emergency(position))
            if setup.watchdog_ms > 0.0:
                watchdog = partial(slave.set_watchdog, "processdata", setup.watchdog_ms)
                self._retry(watchdog)
                if problem := self._watchdog_problem(slave, setup.watchdog_ms):
                    problems.append(f"{setup.name}: {problem}")
        if problems:
            raise ServiceError("\n".join(problems))
        return tuple(found)

    def areas(self) -> tuple[SlaveAreas, ...]:
        """Return where each slave's process data are, from its own FMMUs."""
        return tuple(_areas(self._fmmus(slave)) for slave in self._master.slaves)

    def reference_clock(self) -> int:
        """Return the station of the first slave with a distributed clock; 0 without one."""
        clocks = (
            place for place, slave in enumerate(self._master.slaves) if self._has_clock(slave)
        )
        return next((_FIRST_STATION + place for place in clocks), 0)

    def clock_differences(self) -> tuple[int | None, ...]:
        """Return how far (ns) each slave's clock is from the reference; None without a clock.

        They are those of the last frame with the reference time, without a sign, which controllers
        of several makers define differently.
        """
        return tuple(
            self._register(slave, _DIFFERENCE, 4) & _SIZE if self._has_clock(slave) else None
            for slave in self._master.slaves
        )

    def request(self, state: AlState) -> None:
        """Ask all slaves for a state; do not wait."""
        self._asked.clear()
        self._master.state = state
        self._master.write_state()

    def request_operational(self) -> None:
        """Acknowledge the errors of slaves in SAFE_OPERATIONAL and ask those without for OP.

        The states are those of the last `status`. A slave takes OP only while frames pass; it waits
        for what it needs, and would begin to wait anew with each request, so it is asked again
        only after that time.
        """
        now = time.monotonic()
        for place, slave in enumerate(self._master.slaves):
            if slave.state & 0xF != AlState.SAFE_OPERATIONAL:
                continue
            if slave.state & _ERROR:
                self._asked.pop(place, None)
                slave.state = AlState.SAFE_OPERATIONAL | _ERROR
                slave.write_state()
            elif now - self._asked.get(place, -_REQUEST_INTERVAL_S) >= _REQUEST_INTERVAL_S:
                self._asked[place] = now
                slave.state = AlState.OPERATIONAL
                slave.write_state()

    def status(self) -> tuple[SlaveStatus, ...]:
        """Read the states, and the emergencies that wait in the mailboxes."""
        self._master.read_state()
        for slave in self._master.slaves:
            if slave.state & 0xF > AlState.INIT:
                with suppress(*self._mailbox_errors()):
                    slave.mbx_receive()
        return tuple(
            SlaveStatus(
                slave.state & 0xF,
                slave.al_status if slave.state & _ERROR else 0,
                *self._codes.get(place, (0, 0, 0)),
            )
            for place, slave in enumerate(self._master.slaves)
        )

    def read(self, position: int, index: int, sub: int, kind: str) -> int | None:
        """Return an object's value; None for no answer, a missing object or a wrong size."""
        return self._read(self._master.slaves[position], index, sub, kind)

    def close(self) -> None:
        """Leave the slaves in INIT and close the interface; cannot raise."""
        with suppress(Exception):
            self._master.state = AlState.INIT
            self._master.write_state()
        with suppress(Exception):
            self._master.close()
        if self._flags is not None and not self._flags & _PROMISCUOUS:
            _interface_flags(self._interface, self._flags)

    def _set_up(self, slave: Any, setup: SlaveSetup) -> tuple[Mismatch, ...]:
        if setup.sync0_ns:
            slave.dc_sync(act=True, sync0_cycle_time=setup.sync0_ns)

        def write(step: SetupStep) -> None:
            with suppress(self._pysoem.SdoError):
                slave.sdo_write(step.object, step.sub, to_bytes(step.type, step.value))

        return arming.set_up(
            setup.steps,
            write,
            lambda step: self._read(slave, step.object, step.sub, step.type),
        )

    def _read(self, slave: Any, index: int, sub: int, kind: str) -> int | None:
        for _ in range(1 if slave in self._mute else _READ_ATTEMPTS):
            try:
                data = slave.sdo_read(index, sub)
            except self._pysoem.SdoError:  # the slave's answer: it has no such object
                return None
            except self._mailbox_errors():  # no answer, or an emergency in its place
                continue
            self._mute.discard(slave)
            return from_bytes(kind, data)
        self._mute.add(slave)  # a mailbox that is silent costs 0.7 s each time
        return None

    def _retry(self, request: Callable[[], T]) -> T:
        """Return the result of a request whose frame comes back in time at last.

        pysoem waits 2 ms for an answer, and a busy host takes longer now and then.
        """
        for _ in range(_ATTEMPTS - 1):
            with suppress(self._pysoem.WkcError, self._pysoem.PacketError):
                return request()
        return request()

    def _watchdog_problem(self, slave: Any, expected_ms: float) -> str:
        """Return why a slave would not stop without process data; empty if it would.

        Its watchdog runs only for outputs whose sync manager triggers it, by its EEPROM.
        """
        divider = self._register(slave, _WATCHDOG_DIVIDER, 2) + 2
        found_ms = 4e-5 * divider * self._register(slave, _WATCHDOG_TIME, 2)
        if abs(found_ms - expected_ms) > max(_WATCHDOG_ROUNDING_MS, 0.01 * expected_ms):
            return f"its watchdog lasts {found_ms:g} ms; expected {expected_ms:g} ms"
        for place in range(_SYNC_MANAGERS):
            at = _SYNC_MANAGER + 8 * place
            length, control, activate = (
                self._register(slave, at + offset, size)
                for offset, size in ((2, 2), (4, 1), (6, 1))
            )
            has_outputs = control & _DIRECTION_AND_MODE == _BUFFERED_OUTPUTS
            if activate & 1 and length and has_outputs and not control & _TRIGGERS_WATCHDOG:
                return (
                    f"its outputs do not trigger its watchdog ({at + 4:#06x} is {control:#04x}), "
                    "so it would go on without frames; its EEPROM decides that"
                )
        return ""

    def _mailbox_errors(self) -> tuple[type[Exception], ...]:
        # An emergency in the mailbox comes in place of an answer.
        names = ("SdoError", "MailboxError", "PacketError", "WkcError", "Emergency")
        return tuple(getattr(self._pysoem, name) for name in names)

    def _fmmus(self, slave: Any) -> "list[_Fmmu]":
        data = b"".join(
            self._retry(partial(slave._fprd, _FMMU + _FMMU_SIZE * place, _FMMU_SIZE, _TIMEOUT_US))
            for place in range(_FMMUS)
        )
        fmmus = (_Fmmu(*fields) for fields in _FMMU_LAYOUT.iter_unpack(data))
        return [each for each in fmmus if each.active & 1]

    def missing(self, names: Sequence[str], state: AlState) -> list[str]:
        """Return which slaves are not in a state, and why; ``names``: in the order of the line."""
        self._master.read_state()
        return [
            f"{name}: does not reach {state.name}, is in {state_name(slave.state)} with "
            f"AL status {self.meaning(slave.al_status)}"
            for name, slave in zip(names, self._master.slaves, strict=True)
            if slave.state != state
        ]

    def meaning(self, code: int) -> str:
        """Return an AL status code with its text."""
        return f"{code:#06x}, {self._pysoem.al_status_code_to_string(code)}"

    def _register(self, slave: Any, register: int, size: int) -> int:
        data: bytes = self._retry(partial(slave._fprd, register, size, _TIMEOUT_US))
        return int.from_bytes(data, "little")

    def _has_clock(self, slave: Any) -> bool:
        return bool(self._register(slave, _FEATURES, 2) & _HAS_CLOCK)

    def _note_emergency(self, position: int) -> Callable[[Any], None]:
        def note(emergency: Any) -> None:
            *_, count = self._codes.get(position, (0, 0, 0))
            self._codes[position] = (emergency.error_code, emergency.error_reg, count + 1)

        return note


def _pysoem() -> ModuleType:
    try:
        import pysoem  # noqa: PLC0415 - an optional dependency
    except ImportError as error:
        raise LinkError(
            f"EtherCAT needs pysoem, which is not installed ({error}): pip install "
            "'wec-rig[ethercat]'"
        ) from error
    module: ModuleType = pysoem
    return module


def _open_problem(interface: str) -> str:
    """Return the likely reason why pysoem, which names none, cannot open an interface."""
    try:
        socket.if_nametoindex(interface)
    except OSError:
        return "the kernel has no such interface"
    return "raw sockets need CAP_NET_RAW, and pysoem CAP_NET_ADMIN as well"


def _interface_flags(interface: str, flags: int | None = None) -> int | None:
    """Return the flags of an interface, or set them; None without rights or interface.

    pysoem leaves an interface in promiscuous mode.
    """
    request = struct.pack("16sH14x", interface.encode()[:15], flags or 0)
    with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as own:
        answer = fcntl.ioctl(own, _GET_FLAGS if flags is None else _SET_FLAGS, request)
        found: int = struct.unpack("16sH14x", answer)[1]
        return found
    return None


def _restrict(descriptor: int) -> None:
    """Make pysoem's socket obey its timeouts, and deaf to the answers to the tick's frames."""
    with suppress(OSError):
        own = socket.socket(fileno=os.dup(descriptor))
        try:
            if own.family == socket.AF_PACKET:
                own.setblocking(False)  # of the open file, so also of pysoem's descriptor
                filter_indices(own, SERVICE_INDICES)
        finally:
            own.close()


class _Fmmu(NamedTuple):
    """One mapping of a part of a slave's memory into the process data."""

    logical: int  # address of its first byte
    size: int  # bytes that it touches
    first_bit: int  # in its first byte
    last_bit: int  # in its last byte
    kind: int  # `_READ`, `_WRITE`
    active: int


def _areas(fmmus: list[_Fmmu]) -> SlaveAreas:
    """Return the areas of a slave's FMMUs; those of one direction lie one behind the other."""

    def area(kind: int) -> Area | None:
        spans = [
            (8 * one.logical + one.first_bit, 8 * (one.logical + one.size - 1) + one.last_bit + 1)
            for one in fmmus
            if one.kind & kind
        ]
        if not spans:
            return None
        low, high = min(low for low, _ in spans), max(high for _, high in spans)
        return Area(low, high - low)

    return SlaveAreas(area(_WRITE), area(_READ))


def state_name(state: int) -> str:
    """Return the name of a state with its error bit."""
    name = AlState(state & 0xF).name if state & 0xF in set(AlState) else f"state {state & 0xF}"
    return f"{name} with an error" if state & _ERROR else name


def _text(error: object) -> str:
    return str(error) or type(error).__name__
