"""The tap of a running run: its rows from the ring, without a trace in it."""

import os
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from rig.recording.ring import ProducerState, RingView
from rig.recording.row_layout import Leaf

Rows = np.ndarray[tuple[int, int], np.dtype[np.float64]]
"""Log rows as numbers: one row a tick, one column a leaf."""

HISTORY_S = 60.0  # s that a late joiner sees
_SPARE = 2048  # oldest rows of a full ring that are left out: the loop writes there now
_MAX_ROWS = 16_384  # of one copy


class Tap(Protocol):
    """A source of the rows of a run."""

    leaves: Sequence[Leaf]

    def poll(self) -> Rows:
        """Return the rows that came since the last poll, oldest first."""

    def start_utc_ns(self) -> int:
        """Return the UTC of run time zero, ns; 0 if it is not known (yet)."""

    def status(self) -> dict[str, Any]:
        """Return the state of the source: `unsaved`, `dropped`, `ended`, and for a replay more."""


class RingTap:
    """Reads the ring beside the logger; it holds a map that can only be read."""

    def __init__(self, descriptor: int, leaves: Sequence[Leaf], dt: float) -> None:
        """``descriptor`` of the ring, which is closed here; ``dt``: control period, s.

        ValueError if its rows are not these.
        """
        try:
            self._ring = RingView(descriptor)
        finally:
            os.close(descriptor)
        if self._ring.row_size != 8 * len(leaves):
            raise ValueError(
                f"the run's rows have {self._ring.row_size} bytes, its schema {8 * len(leaves)}"
            )
        self.leaves = leaves
        self.torn = 0  # rows that were overwritten while they were copied, and left out
        self._counts = [at for at, leaf in enumerate(leaves) if leaf.code == "q"]
        self._history = round(HISTORY_S / dt)
        self._polled_head = self._ring.head
        self._next = max(0, self._polled_head - self._history)
        self._newest_tick = -1

    def poll(self) -> Rows:
        """Return the rows below the head of the previous poll that are still there."""
        ready, self._polled_head = self._polled_head, self._ring.head
        if self._ring.state == ProducerState.FINISHED:
            ready = self._polled_head
        oldest = self._polled_head - self._ring.capacity + _SPARE
        self._next = max(self._next, oldest, ready - self._history)
        blocks = []
        while self._next < ready:
            copied = self._ring.copy(self._next, min(ready - self._next, _MAX_ROWS))
            rows = len(copied) // self._ring.row_size
            blocks.append(self._whole_rows(copied))
            self._next += rows
        return np.concatenate(blocks) if blocks else np.empty((0, len(self.leaves)))

    def start_utc_ns(self) -> int:
        """Return the UTC of run time zero, ns; 0 before the loop has begun."""
        return self._ring.start_utc_ns

    def status(self) -> dict[str, Any]:
        """Return the counts of the ring and whether its producer has finished."""
        ring = self._ring
        return {
            "unsaved": ring.head - ring.tail,
            "dropped": ring.dropped,
            "torn": self.torn,
            "ended": ring.state == ProducerState.FINISHED,
        }

    def _whole_rows(self, copied: bytes) -> Rows:
        """Return the rows whose first and last tick agree and follow the row before."""
        counts = np.frombuffer(copied, "<i8").reshape(-1, len(self.leaves))
        numbers: Rows = np.frombuffer(copied, "<f8").reshape(-1, len(self.leaves)).copy()
        numbers[:, self._counts] = counts[:, self._counts]
        ticks = counts[:, 0]
        # A row that was replaced as a whole has a tick from the future of the rows behind it.
        behind = np.minimum.accumulate(ticks[::-1])[::-1]
        whole = (ticks == counts[:, -1]) & (ticks <= behind) & (ticks > self._newest_tick)
        self.torn += int(len(ticks) - whole.sum())
        if whole.any():
            self._newest_tick = int(ticks[whole][-1])
        found: Rows = numbers[whole]
        return found
