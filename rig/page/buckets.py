"""The last minute of a run in buckets of rows: least and greatest value of every field."""

from collections import deque
from typing import NamedTuple

import numpy as np

from rig.page.tap import HISTORY_S, Rows

ROWS = 50  # of a bucket: 20 buckets a second at 1 kHz


class Bucket(NamedTuple):
    """Successive rows; arrays with one entry a field."""

    time: float  # of the last row, s
    low: np.ndarray[tuple[int], np.dtype[np.float64]]
    high: np.ndarray[tuple[int], np.dtype[np.float64]]


class Buckets:
    """The buckets of the last minute, formed once for all who look."""

    def __init__(self, fields: int, time: int, dt: float, rows: int = ROWS) -> None:
        """``fields``: number of them; ``time``: the column of the time; ``dt`` of a row, s."""
        self._time, self._rows = time, rows
        self._waiting: Rows = np.empty((0, fields))
        self.span_s = rows * dt
        self.recent: deque[Bucket] = deque(maxlen=max(1, round(HISTORY_S / self.span_s)))

    def add(self, rows: Rows) -> list[Bucket]:
        """Add rows; return the buckets that became whole."""
        rows = np.concatenate((self._waiting, rows)) if len(self._waiting) else rows
        whole = len(rows) // self._rows * self._rows
        self._waiting = rows[whole:].copy()
        if not whole:
            return []
        parts = rows[:whole].reshape(-1, self._rows, rows.shape[1])
        # NaN is left out where a bucket has numbers; one of NaN alone stays NaN.
        low, high = np.fmin.reduce(parts, axis=1), np.fmax.reduce(parts, axis=1)
        times = parts[:, -1, self._time]
        found = [Bucket(float(t), low[i], high[i]) for i, t in enumerate(times)]
        self.recent.extend(found)
        return found

    def clear(self) -> None:
        """Forget all rows, as after a jump of a replay."""
        self._waiting = self._waiting[:0]
        self.recent.clear()

    def newest(self, seconds: float) -> list[Bucket]:
        """Return the buckets of the last ``seconds``."""
        count = max(1, round(seconds / self.span_s))
        return list(self.recent)[-count:]


def merged(buckets: list[Bucket], most: int) -> list[Bucket]:
    """Return at most ``most`` buckets over the same rows, for a run faster than the clock."""
    if len(buckets) <= most:
        return buckets
    step = -(-len(buckets) // most)
    groups = [buckets[i : i + step] for i in range(0, len(buckets), step)]
    return [
        Bucket(
            group[-1].time,
            np.fmin.reduce([each.low for each in group]),
            np.fmax.reduce([each.high for each in group]),
        )
        for group in groups
    ]
