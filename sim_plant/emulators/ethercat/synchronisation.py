"""SYNC0 as the beat of a slave's application: its pulses, and what ends the synchronisation.

The slave takes outputs and latches inputs with each pulse. Conditions and AL status codes are those
of ETG.1020 as makers' manuals list them: OP is refused without a SYNC unit (0x30), with another
cycle than that of 0x1C32:02 (0x36), before the first pulse (0x2D), and while the clock is far from
the reference (0x32). OP ends without pulses (0x2C), with too many pulses that found no new outputs
(0x1A), and when the clock leaves the reference (0x32).
"""

from __future__ import annotations

from collections.abc import Callable

from sim_plant.emulators import device_objects
from sim_plant.emulators.device_objects import Key, Objects, SdoRefusedError
from sim_plant.emulators.ethercat.al_states import AlCode
from sim_plant.emulators.ethercat.distributed_clock import DistributedClock

OUTPUT_SYNC, INPUT_SYNC = 0x1C32, 0x1C33
TYPE, CYCLE, SUPPORTED_TYPES, SHORTEST_CYCLE, MISSED, SYNC_ERROR = 1, 2, 4, 5, 0x0B, 0x20
BIT_OF_TYPE = {0: 0x01, 1: 0x02, 0x22: 0x02, 2: 0x04}  # of the supported ones
ERROR_SETTINGS, ERROR_LIMIT = 0x10F1, 2  # ETG.1020: limit of the error counter, 0: none
WITH_SYNC0 = 2  # type
MISS, HIT = 3, 1  # a pulse without outputs adds to the error counter, one with them subtracts
LOST_CYCLES = 2  # without a pulse: SYNC0 has stopped
WINDOW = 10  # the clock is at the reference within one part in so many of a cycle


class Sync0:
    """The synchronisation of one slave."""

    def __init__(
        self, objects: Objects, clock: DistributedClock, may_change: Callable[[], bool]
    ) -> None:
        """`may_change`: whether the slave is in PREOP."""
        self._objects, self._clock, self._may_change = objects, clock, may_change
        for index in (OUTPUT_SYNC, INPUT_SYNC):
            objects.guards[index] = self._guard
        self.restart()

    def _guard(self, key: Key, value: int) -> None:
        if not self._may_change():
            raise SdoRefusedError(device_objects.NOT_IN_THIS_STATE)
        index, sub = key
        supported = self._objects.get(index, SUPPORTED_TYPES)
        if sub == TYPE and not supported & BIT_OF_TYPE.get(value, 0):
            raise SdoRefusedError(device_objects.BAD_VALUE)

    def restart(self) -> None:
        """Forget errors and pulses, as before the next OP."""
        self.is_fresh = False  # the master exchanged process data since the last pulse
        self._pulses = self._clock.sync0_count()
        self._errors = 0
        self._last_look = self._clock.true_time()  # ns
        self._last_pulse: int | None = None  # true time, ns

    @property
    def is_chosen(self) -> bool:
        """Whether the application follows SYNC0."""
        return self._objects.values.get((OUTPUT_SYNC, TYPE)) == WITH_SYNC0

    def refusal(self) -> int:
        """Return the AL code against OP, 0 if there is none."""
        cycle = self._clock.sync0_cycle()
        if not cycle:
            return AlCode.INVALID_SYNC
        shortest = self._objects.get(OUTPUT_SYNC, SHORTEST_CYCLE)
        if cycle < shortest or cycle != self._objects.get(OUTPUT_SYNC, CYCLE):
            return AlCode.SYNC0_CYCLE
        return AlCode.NONE

    def missing(self) -> int:
        """Return the AL code of what OP still waits for, 0 if nothing."""
        if self._last_pulse is None:
            return AlCode.NO_SYNC
        return AlCode.NONE if self._is_locked() else AlCode.PLL_ERROR

    def take_pulses(self, *, in_op: bool) -> bool:
        """Return whether SYNC0 came since the last look; in OP, count pulses without new outputs.

        A slave without outputs counts those without a look at its inputs.
        """
        now, count = self._clock.true_time(), self._clock.sync0_count()
        if now < self._last_look:  # a frame that was read late
            return False
        self._last_look = now
        new, self._pulses = count - self._pulses, count
        if new <= 0:  # below 0: the unit was set up anew
            return False
        self._last_pulse = now
        if in_op:
            self._count(new - self.is_fresh, self.is_fresh)
        self.is_fresh = False
        return True

    def _count(self, missed: int, hits: int) -> None:
        objects = self._objects
        objects.put(OUTPUT_SYNC, objects.get(OUTPUT_SYNC, MISSED) + missed & 0xFFFF, MISSED)
        self._errors = max(0, self._errors + MISS * missed - HIT * hits)

    def failure(self) -> int:
        """Return the AL code that ends OP, 0 if the slave was synchronised at the last look."""
        cycle, limit = self._clock.sync0_cycle(), self._objects.get(ERROR_SETTINGS, ERROR_LIMIT)
        last = self._last_pulse
        if not cycle or (last is not None and self._last_look - last > LOST_CYCLES * cycle):
            return AlCode.FATAL_SYNC_ERROR
        code = AlCode.NONE
        if limit and self._errors > limit:
            code = AlCode.SYNC_ERROR
        elif not self._is_locked():
            code = AlCode.PLL_ERROR
        self._objects.put(OUTPUT_SYNC, int(code != AlCode.NONE), SYNC_ERROR)
        return code

    def _is_locked(self) -> bool:
        return WINDOW * self._clock.difference() <= self._clock.sync0_cycle()
