"""The two clocks of the loop. Only here, in driver links and where a run is named is time read."""

import ctypes
import errno
import os
import time
from typing import NamedTuple, Protocol

_NS = 1_000_000_000


class Wake(NamedTuple):
    """One wake-up of the loop."""

    tick: int  # number of the period since the clock was made
    now: float  # s, planned time of this tick since the clock was made
    periods: int  # periods since the last wake-up: 1, more when some were lost
    lateness: float  # s, after the planned time; 0 on a virtual clock


class Clock(Protocol):
    """What the loop needs of a clock."""

    dt: float  # s

    def now(self) -> float:
        """Seconds since the clock was made."""
        ...

    def wait_next(self) -> Wake:
        """Sleep until the next period that is not over yet."""
        ...


def utc_of_zero(clock: Clock) -> int:
    """UTC of the clock's time zero, nanoseconds since 1970: the one mapping a run stores."""
    return time.time_ns() - round(clock.now() * _NS)


class VirtualClock:
    """As fast as the loop goes; time is the number of ticks, so a run is repeatable to the bit."""

    def __init__(self, dt: float) -> None:
        self.dt = dt
        self._tick = -1

    def now(self) -> float:
        return self._tick * self.dt

    def wait_next(self) -> Wake:
        self._tick += 1
        return Wake(self._tick, self._tick * self.dt, 1, 0.0)


class _Timespec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


class RealClock:
    """Absolute deadlines on CLOCK_MONOTONIC; a late wake-up never shifts the ones after it.

    When a deadline is missed by a whole period or more, those periods are skipped and counted:
    the loop never runs a burst of ticks to catch up.
    """

    def __init__(self, dt: float) -> None:
        self.dt = dt
        self._period = round(dt * _NS)
        if self._period <= 0 or abs(self._period - dt * _NS) > 1e-3:
            raise ValueError(f"a period of {dt} s is not a whole number of nanoseconds")
        self._sleep = ctypes.CDLL(None, use_errno=True).clock_nanosleep
        self._until = _Timespec()
        self._until_reference = ctypes.byref(self._until)
        self._tick = -1
        # Tick 0 is more than one period from now, on a multiple of the period of CLOCK_MONOTONIC:
        # what works beside the loop can keep step with it, so that its delay is the same each run.
        self._zero = (time.monotonic_ns() // self._period + 2) * self._period

    def now(self) -> float:
        return (time.monotonic_ns() - self._zero) / _NS

    def wait_next(self) -> Wake:
        due = self._zero + (self._tick + 1) * self._period
        self._until.seconds, self._until.nanoseconds = divmod(due, _NS)
        # CLOCK_MONOTONIC = 1, TIMER_ABSTIME = 1; a signal may cut it short
        while error := self._sleep(1, 1, self._until_reference, None):
            if error != errno.EINTR:
                raise OSError(error, os.strerror(error))
        late = time.monotonic_ns() - due
        periods = 1 + max(0, late // self._period)
        self._tick += periods
        return Wake(self._tick, self._tick * self.dt, periods, late / _NS)
