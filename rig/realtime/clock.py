"""The two clocks of the loop.

Only this module, the driver links and the naming of a run read the time.
"""

import ctypes
import errno
import os
import time
from collections.abc import Callable
from typing import NamedTuple, Protocol

_NS = 1_000_000_000
# Times of a real clock that prepares ticks. In HIL runs at 1 kHz on a busy virtual machine sleeps
# ended 46 us late (p50; p99 from 118 us on), and the preparation of a tick took 82 us (p99 167 us).
_EARLY_NS = 200_000  # end of the sleep before the tick
_ENOUGH_NS = 100_000  # left then, or the tick is not prepared
_MOMENT_S = 0.002
_SHORTEST_PREPARED_NS = 1_000_000  # a shorter period has no time for it


class Wake(NamedTuple):
    """One wake-up of the loop."""

    tick: int  # number of the period since the clock was created
    now: float  # s, planned time of this tick since the clock was created
    periods: int  # periods since the last wake-up: 1, more after a missed deadline
    lateness: float  # s, wake-up after the planned time; 0 on a virtual clock


class Clock(Protocol):
    """Interface of a clock that drives the loop."""

    dt: float  # s

    def now(self) -> float:
        """Return the seconds since the clock was created."""

    def wait_next(self) -> Wake:
        """Sleep until the start of the next period that has not passed yet."""

    def stands_still(self) -> bool:
        """Return whether time can wait for something outside; if so, give it a moment."""

    def prepare_ticks(self, prepare: Callable[[], object]) -> None:
        """Call a function shortly before each tick from now on, where there is time for it."""

    def follow(self, correction: Callable[[], int]) -> None:
        """Move each deadline and those after it by what a function returns (ns) from now on."""


def utc_of_zero(clock: Clock) -> int:
    """Return the UTC of the clock's zero, ns since 1970: the one mapping that a run stores."""
    return time.time_ns() - round(clock.now() * _NS)


class VirtualClock:
    """A clock that never sleeps: time is the number of ticks, so a run repeats bit for bit."""

    def __init__(self, dt: float) -> None:
        self.dt = dt
        self._tick = -1

    def now(self) -> float:
        return self._tick * self.dt

    def wait_next(self) -> Wake:
        self._tick += 1
        return Wake(self._tick, self._tick * self.dt, 1, 0.0)

    def stands_still(self) -> bool:
        time.sleep(_MOMENT_S)
        return True

    def prepare_ticks(self, prepare: Callable[[], object]) -> None:
        """Do nothing: no time passes before a tick."""

    def follow(self, correction: Callable[[], int]) -> None:
        """Do nothing: no other clock runs beside this one."""


class _Timespec(ctypes.Structure):
    _fields_ = (("seconds", ctypes.c_long), ("nanoseconds", ctypes.c_long))


class RealClock:
    """Absolute deadlines on CLOCK_MONOTONIC; a late wake-up never shifts the ones after it.

    When the loop misses a deadline by a whole period or more, those periods are skipped and
    counted: the loop never runs a burst of ticks to catch up.
    """

    def __init__(self, dt: float) -> None:
        self.dt = dt
        self._period = round(dt * _NS)
        if self._period <= 0 or abs(self._period - dt * _NS) > 1e-3:
            raise ValueError(f"a period of {dt} s is not a whole number of nanoseconds")
        self._sleep = ctypes.CDLL(None, use_errno=True).clock_nanosleep
        self._deadline = _Timespec()
        self._deadline_reference = ctypes.byref(self._deadline)
        self._tick = -1
        self._prepare: Callable[[], object] | None = None
        self._correction: Callable[[], int] | None = None
        # Tick 0 is more than one period from now, on a multiple of the period of CLOCK_MONOTONIC:
        # other processes can keep in step with the loop, so their delay is the same in each run.
        self._zero = (time.monotonic_ns() // self._period + 2) * self._period

    def now(self) -> float:
        return (time.monotonic_ns() - self._zero) / _NS

    def stands_still(self) -> bool:
        return False

    def prepare_ticks(self, prepare: Callable[[], object]) -> None:
        """Wake up early from now on, call ``prepare``, and wait for the tick without sleeping.

        A tick then begins on time, and its code and data are in the caches of the processor
        (docs/explanation/decisions/0015-one-tick-two-executions.md has the measurements). A second
        sleep instead of the loop below wakes up as late as the first.
        """
        if self._period >= _SHORTEST_PREPARED_NS:
            self._prepare = prepare

    def follow(self, correction: Callable[[], int]) -> None:
        """Move the deadlines: the clock of the wires leads, e.g. that of an EtherCAT segment.

        The first correction moves them from multiples of the period of CLOCK_MONOTONIC.
        """
        self._correction = correction

    def wait_next(self) -> Wake:
        if self._correction is not None:
            self._zero += self._correction()
        due = self._zero + (self._tick + 1) * self._period
        if self._prepare is None:
            self._sleep_until(due)
        else:
            self._sleep_until(due - _EARLY_NS)
            if time.monotonic_ns() <= due - _ENOUGH_NS:
                self._prepare()
            while time.monotonic_ns() < due:
                pass
        lateness_ns = time.monotonic_ns() - due
        periods = 1 + max(0, lateness_ns // self._period)
        self._tick += periods
        return Wake(self._tick, self._tick * self.dt, periods, lateness_ns / _NS)

    def _sleep_until(self, due: int) -> None:
        self._deadline.seconds, self._deadline.nanoseconds = divmod(due, _NS)
        # CLOCK_MONOTONIC = 1, TIMER_ABSTIME = 1; a signal may interrupt the sleep
        while error := self._sleep(1, 1, self._deadline_reference, None):
            if error != errno.EINTR:
                raise OSError(error, os.strerror(error))
