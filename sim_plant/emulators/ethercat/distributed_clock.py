"""The distributed clock of a slave: local time, system time, port times, SYNC0 (0x0900 to 0x09AF).

Times are integers in ns. The local clock may run wrong; writes to 0x0910 (FRMW of the master, with
the time of the reference clock) pull the system time to it, as the controller's filter does.
"""

from __future__ import annotations

from collections.abc import Callable

from sim_plant.emulators.ethercat import registers
from sim_plant.emulators.ethercat.controller import SlaveController

HOP_DELAY = 500  # ns from one slave to the next
CORRECTION = 8  # a write of the reference time removes one part in so many of the difference
CYCLIC, SYNC0 = 0x01, 0x02  # activation
NS = 1_000_000_000
_64_BITS, _32_BITS = (1 << 64) - 1, (1 << 32) - 1


class DistributedClock:
    """Clock and SYNC unit of one slave."""

    def __init__(self, controller: SlaveController, clock: Callable[[], int]) -> None:
        """`clock` returns the true time in ns; it never decreases."""
        self._controller = controller
        self._clock = clock
        self.slaves_behind = 0  # in the line: for the port times
        self.receive_delay = 0  # ns, from the master to this slave
        self._rate = 1.0
        self._anchor = 0, 0  # true and local time when the rate was set
        self._correction = 0  # ns, of the control loop
        self._arrived: int | None = None  # true time in ns of the frame that is here
        self._stopped_at: int | None = None  # pulses of SYNC0 at the fault that ended them
        self.power_on(0)
        if controller.has_dc:
            start, end = registers.SYSTEM_TIME, registers.SYSTEM_TIME + 8
            controller.before_read.add(start, end, self._on_read)
            controller.after_write.add(start, end, self._on_reference)
            start = registers.SPEED_START
            controller.after_write.add(start, start + 2, self._on_speed_start)
            latch = registers.PORT_TIMES
            controller.after_write.add(latch, latch + 4, self._on_latch)

    def power_on(self, local_time: int) -> None:
        """Start the local clock at a time."""
        self._anchor = self.true_time(), local_time
        self._correction = 0

    def set_drift(self, ppm: float) -> None:
        """Let the local clock run fast (or, negative, slow) from now on."""
        self._anchor = self.true_time(), self._own_time()
        self._rate = 1.0 + 1.0e-6 * ppm

    def jump(self, ns: int) -> None:
        """Shift the local clock at once."""
        true, local = self._anchor
        self._anchor = true, local + ns

    def hold(self, arrived: int | None) -> None:
        """Let the clock stand at the true time at which a frame arrived; None: it goes on.

        A controller takes the times of a frame as it passes, so those of all slaves are of one
        moment, however long this process takes.
        """
        self._arrived = arrived

    def true_time(self) -> int:
        """Return the true time, ns."""
        return self._clock() if self._arrived is None else self._arrived

    def local_time(self) -> int:
        """Return the local time at which a frame that is here now came in, ns."""
        return self._own_time() + self.receive_delay

    def _own_time(self) -> int:
        true, local = self._anchor
        elapsed = self.true_time() - true
        if self._rate != 1.0:
            elapsed = round(elapsed * self._rate)
        return local + elapsed

    def system_time(self) -> int:
        """Return the system time, ns."""
        offset = self._controller.get(registers.SYSTEM_OFFSET, 8)
        return self.local_time() + offset + self._correction & _64_BITS

    def sync0_cycle(self) -> int:
        """Return the cycle of SYNC0 in ns, 0 while it is off."""
        controller = self._controller
        if not controller.has_dc:
            return 0
        active = controller.memory[registers.SYNC_ACTIVATION] & (CYCLIC | SYNC0)
        return controller.get(registers.SYNC0_CYCLE, 4) if active == CYCLIC | SYNC0 else 0

    def sync0_count(self) -> int:
        """Return the number of SYNC0 pulses since the start time, 0 before it or while off."""
        return self._count() if self._stopped_at is None else self._stopped_at

    def stop_pulses(self, stopped: bool) -> None:
        """Let SYNC0 give no more pulses, or go on: a fault of the unit."""
        if stopped != (self._stopped_at is not None):
            self._stopped_at = self._count() if stopped else None

    def _count(self) -> int:
        cycle = self.sync0_cycle()
        if not cycle:
            return 0
        since = self.system_time() - self._controller.get(registers.SYNC_START, 8)
        return max(0, since // cycle + 1)

    def difference(self) -> int:
        """Return how far (ns) the clock is from the reference, as last compared."""
        return self._controller.get(registers.SYSTEM_DIFFERENCE, 4) & 0x7FFF_FFFF

    def next_sync0(self) -> int:
        """Return the time in ns until the next pulse of SYNC0, which must be on."""
        cycle = self.sync0_cycle()
        since = self.system_time() - self._controller.get(registers.SYNC_START, 8)
        return cycle - since % cycle if since >= 0 else -since

    def _on_read(self) -> None:
        self._controller.set(registers.SYSTEM_TIME, self.system_time(), 8)

    def _on_reference(self) -> None:
        """Compare the written time, and the delay from the reference, with the own time."""
        controller = self._controller
        delay = controller.get(registers.SYSTEM_DELAY, 4)
        written = controller.get(registers.SYSTEM_TIME, 4)
        difference = self.system_time() - delay - written & _32_BITS
        if difference >> 31:
            difference -= 1 << 32
        sign = 1 << 31 if difference > 0 else 0  # set: the own time is ahead
        magnitude = min(abs(difference), _32_BITS >> 1)
        controller.set(registers.SYSTEM_DIFFERENCE, sign | magnitude, 4)
        step = difference // CORRECTION if difference > 0 else -(-difference // CORRECTION)
        self._correction -= step or (difference > 0) - (difference < 0)

    def _on_speed_start(self) -> None:
        """Begin the comparison anew: a write of 0x0930 empties its filters."""
        self._controller.set(registers.SYSTEM_DIFFERENCE, 0, 4)

    def _on_latch(self) -> None:
        """Latch the times at which the frame came from the master and back from the slaves behind.

        Written to all slaves at once; a port without a slave behind keeps 0.
        """
        controller, local = self._controller, self.local_time()
        times = [local, 0, 0, 0]
        if self.slaves_behind:
            times[1] = local + 2 * HOP_DELAY * self.slaves_behind
        for port, time in enumerate(times):
            controller.set(registers.PORT_TIMES + 4 * port, time, 4)
        controller.set(registers.RECEIVE_TIME, local, 8)
