"""Which ticks of a run are in its record and which are not, exactly.

A period that the loop itself skipped (it woke too late) is counted in the next row, so it can be
told from a row that was lost: of the ticks absent between two rows, as many were skipped as the
count ``timing.skipped`` went up.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from rig.recording.runs.mcap_file import Records

SKIPPED = "timing.skipped"


class Gap(NamedTuple):
    """Neighbouring ticks without a row."""

    first: int  # tick
    last: int  # tick
    skipped: int  # of them, how many the loop never executed

    @property
    def absent(self) -> int:
        """Ticks without a row."""
        return self.last - self.first + 1

    @property
    def lost(self) -> int:
        """Executed ticks whose row is not in the record."""
        return self.absent - self.skipped


class Ending(NamedTuple):
    """What somebody who saw the loop wrote down."""

    ticks: int  # executed
    last_tick: int | None  # newest that was handed over
    skipped: int | None  # periods lost by the loop, in all
    witness: str  # who says so
    final: bool  # saw the loop end; otherwise ticks may have followed


class Account(NamedTuple):
    """The ticks of a record."""

    rows: int
    first_tick: int | None
    last_tick: int | None
    period: float | None  # s from tick to tick; None if one row or none is there
    gaps: tuple[Gap, ...]  # from tick 0 on, in order
    beyond: int  # executed after the last known tick, number of it unknown, row lost
    ending: Ending | None  # None: nobody noted anything, so ticks may have followed the last row

    @property
    def lost(self) -> int:
        """Executed ticks known to have no row."""
        return self.beyond + sum(gap.lost for gap in self.gaps)

    @property
    def last_known(self) -> int | None:
        """Newest tick that is in the record or was noted by anyone."""
        noted = None if self.ending is None else self.ending.last_tick
        known = [tick for tick in (self.last_tick, noted) if tick is not None]
        return max(known, default=None)

    @property
    def skipped(self) -> int:
        """Periods the loop itself skipped, before or between rows."""
        return sum(gap.skipped for gap in self.gaps)

    @property
    def whole(self) -> bool:
        """Every executed tick is in the record, and it is known that none followed."""
        return self.lost == 0 and self.ending is not None and self.ending.final


class Counting:
    """The ticks of a record, counted while it is read in order, each tick once."""

    def __init__(self) -> None:
        self._rows, self._tick, self._skipped = 0, -1, 0
        self._first: tuple[int, float] | None = None
        self._latest = (0, 0.0)
        self._gaps: list[Gap] = []

    def add(self, block: Records) -> None:
        """Count the next rows."""
        if len(block) == 0:
            return
        if self._first is None:
            self._first = int(block["tick"][0]), float(block["time"][0])
        self._gaps += _gaps(block, self._tick, self._skipped)
        self._rows += len(block)
        self._tick = int(block["tick"][-1])
        self._skipped = _last_skipped(block, self._skipped)
        self._latest = self._tick, float(block["time"][-1])

    def result(self, ending: Ending | None) -> Account:
        """The account, by what somebody who saw the loop wrote down."""
        gaps = list(self._gaps)
        if ending is not None and ending.last_tick is not None and ending.last_tick > self._tick:
            absent = ending.last_tick - self._tick
            more = absent if ending.skipped is None else ending.skipped - self._skipped
            gaps.append(Gap(self._tick + 1, ending.last_tick, _within(0, more, absent)))
        known = self._rows + sum(gap.lost for gap in gaps)
        beyond = 0 if ending is None else max(0, ending.ticks - known)
        return Account(
            self._rows,
            None if self._first is None else self._first[0],
            None if self._first is None else self._latest[0],
            _period(self._first, self._latest),
            tuple(gaps),
            beyond,
            ending,
        )


def account(blocks: Iterable[Records], ending: Ending | None) -> Account:
    """Count the ticks of a record given in order, each tick once."""
    counting = Counting()
    for block in blocks:
        counting.add(block)
    return counting.result(ending)


def _period(first: tuple[int, float] | None, latest: tuple[int, float]) -> float | None:
    if first is None or first[0] == latest[0]:
        return None
    return (latest[1] - first[1]) / (latest[0] - first[0])


def _last_skipped(block: Records, before: int) -> int:
    return int(block[SKIPPED][-1]) if SKIPPED in (block.dtype.names or ()) else before


def _gaps(block: Records, tick: int, skipped: int) -> list[Gap]:
    ticks = np.concatenate(([tick], block["tick"].astype(np.int64)))
    counted: Any = np.zeros(len(ticks), np.int64)
    if SKIPPED in (block.dtype.names or ()):
        counted = np.concatenate(([skipped], block[SKIPPED].astype(np.int64)))
    absent = np.diff(ticks) - 1
    return [
        Gap(
            int(ticks[i]) + 1,
            int(ticks[i + 1]) - 1,
            _within(0, int(counted[i + 1] - counted[i]), int(absent[i])),
        )
        for i in np.flatnonzero(absent > 0).tolist()
    ]


def _within(low: int, value: int, high: int) -> int:
    return min(max(low, value), high)
