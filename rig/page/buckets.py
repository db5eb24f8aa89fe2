"""The last hour of a run in buckets of rows: least and greatest value of every field.

The last minute has the finest buckets, ten minutes and the hour have coarser ones. All of them have
their memory from the start, so that the page does not grow over an hour.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.page.tap import HISTORY_S, Rows

ROWS = 50  # of a finest bucket: 20 buckets a second at 1 kHz
COARSER = (10, 60)  # finest buckets of a bucket of the coarser levels
Times = np.ndarray[tuple[int], np.dtype[np.float64]]
Places = np.ndarray[tuple[int], np.dtype[np.int64]]


class Extremes(NamedTuple):
    """Successive buckets."""

    time: Times  # of the last row of each, s
    low: Rows  # one row a bucket, one column a field
    high: Rows

    @property
    def size(self) -> int:
        """The number of buckets."""
        return len(self.time)

    def at(self, places: slice | Places) -> "Extremes":
        """Return the buckets at places."""
        return Extremes(self.time[places], self.low[places], self.high[places])

    def put(self, places: slice | Places, buckets: "Extremes") -> None:
        """Replace the buckets at places."""
        self.time[places], self.low[places], self.high[places] = buckets

    def merged(self, size: int) -> "Extremes":
        """Return buckets of ``size`` of these; the last one may have fewer."""
        starts = np.arange(0, self.size, size)
        if not len(starts):
            return self
        ends = np.append(starts[1:], self.size) - 1
        # NaN is left out where a bucket has numbers; one of NaN alone stays NaN.
        low, high = np.fmin.reduceat(self.low, starts), np.fmax.reduceat(self.high, starts)
        return Extremes(self.time[ends], low, high)


def _memory(buckets: int, fields: int) -> Extremes:
    """Return room for buckets: filled, as the kernel gives a page when it is first written."""
    shape = buckets, fields
    return Extremes(np.full(buckets, np.nan), np.full(shape, np.nan), np.full(shape, np.nan))


class Level:
    """The newest buckets of one size."""

    def __init__(self, parts: int, most: int, fields: int) -> None:
        """``parts`` of a bucket: rows, or buckets of a finer level; ``most`` buckets are kept."""
        self._kept, self._parts = _memory(most, fields), _memory(parts, fields)
        self.clear()

    def clear(self) -> None:
        """Forget all buckets."""
        self._count = self._waiting = 0  # buckets since then; parts of the next one

    def add(self, parts: Extremes) -> Extremes:
        """Add parts; return the buckets that became whole."""
        waiting, size, most = self._parts.at(slice(self._waiting)), self._parts.size, self._most
        joined = Extremes(
            np.concatenate((waiting.time, parts.time)),
            np.concatenate((waiting.low, parts.low)),
            np.concatenate((waiting.high, parts.high)),
        )
        whole = joined.size // size * size
        self._waiting = joined.size - whole
        self._parts.put(slice(self._waiting), joined.at(slice(whole, None)))
        found = joined.at(slice(whole)).merged(size)
        self._count += found.size
        kept = found.at(slice(-most, None))
        self._kept.put(np.arange(self._count - kept.size, self._count) % most, kept)
        return found

    def newest(self, count: int, columns: Sequence[int]) -> Extremes:
        """Return the last ``count`` buckets, or as many as there are, with these columns."""
        count = min(count, self._count, self._most)
        found = self._kept.at(np.arange(self._count - count, self._count) % self._most)
        return found._replace(low=found.low[:, columns], high=found.high[:, columns])

    @property
    def _most(self) -> int:
        return self._kept.size


class Buckets:
    """The buckets of a run, formed once for all who look."""

    def __init__(self, fields: int, time: int, dt: float, rows: int = ROWS) -> None:
        """``fields``: number of them; ``time``: the column of the time; ``dt`` of a row, s."""
        self._time = time
        self.span_s = rows * dt
        self._most = max(1, round(HISTORY_S / self.span_s))  # buckets, of each level
        self._levels = [Level(size, self._most, fields) for size in (rows, *COARSER)]

    def add(self, rows: Rows) -> Extremes:
        """Add rows; return the buckets that became whole."""
        finest, *coarser = self._levels
        found = finest.add(Extremes(rows[:, self._time], rows, rows))
        for each in coarser:
            each.add(found)
        return found

    def clear(self) -> None:
        """Forget all rows, as after a jump of a replay."""
        for each in self._levels:
            each.clear()

    def newest(self, seconds: float, columns: Sequence[int]) -> Extremes:
        """Return the buckets of the last ``seconds``, with these columns."""
        return self._levels[0].newest(max(1, round(seconds / self.span_s)), columns)

    def history(self, columns: Sequence[int]) -> list[Extremes]:
        """Return all buckets of every level, the finest first, with these columns."""
        return [each.newest(self._most, columns) for each in self._levels]


def merged(buckets: Extremes, most: int) -> Extremes:
    """Return at most ``most`` buckets over the same rows, for a run faster than the clock."""
    return buckets.merged(max(1, -(-buckets.size // most)))
