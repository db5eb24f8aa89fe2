"""The AL state machine of a slave: 0x0120 requested, 0x0130 present, 0x0134 reason of an error."""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Protocol

from sim_plant.emulators.ethercat import registers
from sim_plant.emulators.ethercat.controller import SlaveController

OP_TIMEOUT_NS = 1_000_000_000  # from the request of OP to all that it waits for
ERROR = ACKNOWLEDGE = 0x10  # bit of status, of control


class AlState(IntEnum):
    """States; each but INIT and BOOT has its predecessor in the order of value."""

    INIT = 1
    PREOP = 2
    BOOT = 3
    SAFEOP = 4
    OP = 8


class AlCode(IntEnum):
    """Reasons of an error."""

    NONE = 0x0000
    INVALID_CHANGE = 0x0011
    UNKNOWN_STATE = 0x0012
    NO_BOOT = 0x0013
    INVALID_MAILBOX = 0x0016
    SYNC_ERROR = 0x001A
    WATCHDOG = 0x001B
    INVALID_OUTPUTS = 0x001D
    INVALID_INPUTS = 0x001E
    FATAL_SYNC_ERROR = 0x002C
    NO_SYNC = 0x002D
    INVALID_SYNC = 0x0030
    PLL_ERROR = 0x0032
    SYNC0_CYCLE = 0x0036
    EEPROM_ERROR = 0x0051


_NEXT = {AlState.INIT: AlState.PREOP, AlState.PREOP: AlState.SAFEOP, AlState.SAFEOP: AlState.OP}
_STATES = frozenset(AlState)


class Application(Protocol):
    """The part of a slave that decides on a change of state and follows it."""

    def refusal(self, target: AlState) -> int:
        """Return the code against the step up to a state, 0 if there is none."""
        ...

    def missing(self) -> int:
        """Return the code of what OP still waits for, 0 if it may begin."""
        ...

    def on_state(self, old: AlState, new: AlState, code: int) -> None:
        """Follow a change of state; `code` is its reason if it was not requested."""
        ...


class AlMachine:
    """The AL state machine of one slave."""

    def __init__(
        self, controller: SlaveController, application: Application, clock: Callable[[], int]
    ) -> None:
        """`clock`: time in ns."""
        self._controller = controller
        self._application = application
        self.state = AlState.INIT
        self.has_error = False
        self._op_requested_at: int | None = None  # ns; waits for outputs and SYNC0
        self._clock = clock
        start = registers.AL_CONTROL
        controller.after_write.add(start, start + 2, self._on_control)

    def power_on(self) -> None:
        """Begin in INIT."""
        self.state, self.has_error, self._op_requested_at = AlState.INIT, False, None
        self._show(AlCode.NONE)

    def poll(self, now: int) -> None:
        """Finish or abandon a step to OP that waits for something; `now` in ns."""
        if self._op_requested_at is None:
            return
        missing = self._application.missing()
        if not missing:
            self._op_requested_at = None
            self._enter(AlState.OP)
        elif now - self._op_requested_at > OP_TIMEOUT_NS:
            self._op_requested_at = None
            self._refuse(missing)

    def fail(self, state: AlState, code: int) -> None:
        """Fall back to a state with an error, without a request."""
        old, self.state = self.state, min(self.state, state)
        self.has_error, self._op_requested_at = True, None
        self._show(code)
        self._application.on_state(old, self.state, code)

    def _on_control(self) -> None:
        control = self._controller.get(registers.AL_CONTROL, 2)
        requested = control & 0x0F
        if self.has_error:
            if not control & ACKNOWLEDGE:
                return
            self.has_error = False
            self._show(AlCode.NONE)
        if requested not in _STATES:
            self._refuse(AlCode.UNKNOWN_STATE)
            return
        target = AlState(requested)
        self._op_requested_at = None
        if target is AlState.BOOT:
            self._refuse(AlCode.NO_BOOT)
        elif target <= self.state:
            self._enter(target)
        elif _NEXT.get(self.state) is not target:
            self._refuse(AlCode.INVALID_CHANGE)
        elif code := self._application.refusal(target):
            self._refuse(code)
        elif target is AlState.OP and self._application.missing():
            self._op_requested_at = self._clock()
        else:
            self._enter(target)

    def _enter(self, target: AlState) -> None:
        old, self.state = self.state, target
        self._show(AlCode.NONE)
        if old is not target:
            self._application.on_state(old, target, AlCode.NONE)

    def _refuse(self, code: int) -> None:
        self.has_error = True
        self._show(code)

    def _show(self, code: int) -> None:
        status = self.state | (ERROR if self.has_error else 0)
        self._controller.set(registers.AL_STATUS, status, 2)
        self._controller.set(registers.AL_STATUS_CODE, code, 2)
