"""The last hour of a run in buckets of rows: least and greatest value of every field.

The last minute has the finest buckets, ten minutes and the hour have coarser ones.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from rig.page.tap import HISTORY_S, Rows

ROWS = 50  # of a finest bucket: 20 buckets a second at 1 kHz
COARSER = (10, 60)  # finest buckets of a bucket of the coarser levels


class Bucket(NamedTuple):
    """Successive rows; arrays with one entry a field."""

    time: float  # of the last row, s
    low: np.ndarray[tuple[int], np.dtype[np.float64]]
    high: np.ndarray[tuple[int], np.dtype[np.float64]]


class Buckets:
    """The buckets of a run, formed once for all who look."""

    def __init__(self, fields: int, time: int, dt: float, rows: int = ROWS) -> None:
        """``fields``: number of them; ``time``: the column of the time; ``dt`` of a row, s."""
        self._time, self._rows = time, rows
        self._waiting: Rows = np.empty((0, fields))
        self.span_s = rows * dt
        most = max(1, round(HISTORY_S / self.span_s))  # buckets, of each level
        self.recent: deque[Bucket] = deque(maxlen=most)
        self.coarser: tuple[deque[Bucket], ...] = tuple(deque(maxlen=most) for _ in COARSER)
        self._parts: tuple[list[Bucket], ...] = tuple([] for _ in COARSER)

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
        for size, coarse, open_bucket in zip(COARSER, self.coarser, self._parts, strict=True):
            for each in found:
                open_bucket.append(each)
                if len(open_bucket) == size:
                    coarse.append(_merge(open_bucket))
                    open_bucket.clear()
        return found

    def clear(self) -> None:
        """Forget all rows, as after a jump of a replay."""
        self._waiting = self._waiting[:0]
        for each in (self.recent, *self.coarser, *self._parts):
            each.clear()

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
    return [_merge(group) for group in groups]


def _merge(group: list[Bucket]) -> Bucket:
    low = np.fmin.reduce([each.low for each in group])
    high = np.fmax.reduce([each.high for each in group])
    return Bucket(group[-1].time, low, high)
