"""The watchdog of a WAGO 750 fieldbus coupler. Pure: time is an argument.

Source: WAGO 750 manuals, section MODBUS functions, internal variables 0x1000 to 0x100B. Not
confirmed, and therefore parameters or named here: the unit of the time; the exception code of a
refusal; that a masked function code renews a running watchdog but does not start one.
"""

from __future__ import annotations

from enum import IntEnum

from sim_plant.emulators.modbus_pdu import ExceptionCode, ModbusRefusalError
from sim_plant.units import Second

TIME, MASK_1_16, MASK_17_32, TRIGGER, SHORTEST = 0x1000, 0x1001, 0x1002, 0x1003, 0x1004
STOP, STATUS, RESTART, SIMPLE_STOP, CLOSE_SOCKETS = 0x1005, 0x1006, 0x1007, 0x1008, 0x1009
ALTERNATIVE, SAVE = 0x100A, 0x100B
FIRST, LAST = TIME, SAVE


class Status(IntEnum):
    """Register 0x1006."""

    NOT_ACTIVE = 0
    ACTIVE = 1
    EXHAUSTED = 2


class ModuleWatchdog:
    """Counts down while active; once expired, it keeps the outputs at 0 until it is renewed."""

    def __init__(self, unit: Second = 0.1) -> None:
        """`unit`: time of one count of register 0x1000."""
        self._unit = unit
        self._registers = dict.fromkeys(range(FIRST, LAST + 1), 0)
        self._registers[SHORTEST] = 0xFFFF
        self._deadline: Second = 0.0
        self.status = Status.NOT_ACTIVE

    def read(self, address: int) -> int:
        """Return the value of a register."""
        return int(self.status) if address == STATUS else self._registers[address]

    def write(self, address: int, value: int, now: Second) -> None:
        """Write a register. Raises ModbusRefusalError if it may not be written now."""
        active = self.status is Status.ACTIVE
        if address in (TIME, MASK_1_16, MASK_17_32) and active:
            raise ModbusRefusalError(
                ExceptionCode.ILLEGAL_VALUE
            )  # "not possible ... while it is running"
        if address in (SHORTEST, STATUS):
            raise ModbusRefusalError(ExceptionCode.ILLEGAL_ADDRESS)
        before = self._registers[address]
        if address == TRIGGER and value != before:
            if self.status is not Status.EXHAUSTED and (value != 0 or active):
                self._start(now)
        elif address == STOP and (before, value) == (0xAAAA, 0x5555):
            self.status = Status.NOT_ACTIVE
        elif address == RESTART and value == 1 and self.status is not Status.NOT_ACTIVE:
            self._start(now)
        elif address == SIMPLE_STOP and value in (0xAA55, 0x55AA):
            self.status = Status.NOT_ACTIVE
        self._registers[address] = value

    def on_request(self, function: int, now: Second) -> None:
        """Renew the watchdog if it is configured for requests with this function code."""
        if self._registers[ALTERNATIVE] == 1:
            self._start(now)
        elif self.status is Status.ACTIVE:
            mask = self._registers[MASK_1_16] | self._registers[MASK_17_32] << 16
            if mask >> (function - 1) & 1:
                self._start(now)

    def check_expired(self, now: Second) -> bool:
        """Advance to `now`; return True once, when the watchdog expires."""
        if self.status is not Status.ACTIVE or now < self._deadline:
            return False
        self._registers[SHORTEST] = 0
        self.status = Status.EXHAUSTED
        return True

    def closes_sockets(self) -> bool:
        """Return whether connections must end when the watchdog expires (0x1009)."""
        return self._registers[CLOSE_SOCKETS] == 1

    def _start(self, now: Second) -> None:
        if self._registers[TIME] == 0:
            return
        if self.status is Status.ACTIVE:
            remaining = max(int((self._deadline - now) / self._unit), 0)
            self._registers[SHORTEST] = min(self._registers[SHORTEST], remaining)
        self._deadline = now + self._registers[TIME] * self._unit
        self.status = Status.ACTIVE
