"""Moments a period apart, for programs that exchange frames outside the loop's ticks."""

import time


class Pace:
    """Deadlines on CLOCK_MONOTONIC; after a stall they go on from the present, without a burst."""

    def __init__(self, period_ns: int) -> None:
        self.due_ns = time.monotonic_ns()
        self._period_ns = period_ns

    def wait(self, correction_ns: int = 0) -> None:
        """Sleep until the next deadline, which a correction moves with all after it."""
        now = time.monotonic_ns()
        self.due_ns = max(now, self.due_ns + self._period_ns + correction_ns)
        time.sleep(1e-9 * (self.due_ns - now))
