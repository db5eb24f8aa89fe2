"""Exact account of a run's ticks: which are in its record and which are not.

A period that the loop itself skipped (it woke too late) is counted in the next row, which separates
it from a lost row: of the ticks missing between two rows, the increase of the count
``timing.skipped`` were skipped.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from rig.recording.runs.mcap_file import Records

SKIPPED = "timing.skipped"


class Gap(NamedTuple):
    """Consecutive ticks without a row."""

    first: int  # tick
    last: int  # tick
    skipped: int  # number of these ticks that the loop never executed

    @property
    def missing(self) -> int:
        """Number of ticks without a row."""
        return self.last - self.first + 1

    @property
    def lost(self) -> int:
        """Number of executed ticks whose row is not in the record."""
        return self.missing - self.skipped


class EndReport(NamedTuple):
    """Report on the loop's end by a process that observed it."""

    ticks: int  # executed ticks
    last_tick: int | None  # newest tick that was handed over
    skipped: int | None  # periods skipped by the loop, in total
    source: str  # process that wrote the report
    final: bool  # True: it observed the loop's end; otherwise ticks may have followed


class TickAccount(NamedTuple):
    """The ticks of a record."""

    rows: int
    first_tick: int | None
    last_tick: int | None
    period: float | None  # s from tick to tick; None with less than two rows
    gaps: tuple[Gap, ...]  # from tick 0 on, in order
    lost_at_end: int  # executed ticks after the last known one, whose rows are lost
    end_report: EndReport | None  # None: no report, so ticks may have followed the last row

    @property
    def lost(self) -> int:
        """Number of executed ticks known to have no row."""
        return self.lost_at_end + sum(gap.lost for gap in self.gaps)

    @property
    def last_known(self) -> int | None:
        """Newest tick that is in the record or in the end report."""
        reported = None if self.end_report is None else self.end_report.last_tick
        known = [tick for tick in (self.last_tick, reported) if tick is not None]
        return max(known, default=None)

    @property
    def skipped(self) -> int:
        """Number of periods that the loop skipped, before or between rows."""
        return sum(gap.skipped for gap in self.gaps)

    @property
    def complete(self) -> bool:
        """Whether every executed tick is in the record, and none is known to have followed."""
        return self.lost == 0 and self.end_report is not None and self.end_report.final


class TickCounter:
    """Counts the ticks of a record that is read in order, each tick once."""

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

    def result(self, end_report: EndReport | None) -> TickAccount:
        """Return the account of the rows so far, completed by an end report."""
        gaps = list(self._gaps)
        if (
            end_report is not None
            and end_report.last_tick is not None
            and end_report.last_tick > self._tick
        ):
            missing = end_report.last_tick - self._tick
            skipped = missing if end_report.skipped is None else end_report.skipped - self._skipped
            gaps.append(Gap(self._tick + 1, end_report.last_tick, _clamp(0, skipped, missing)))
        known = self._rows + sum(gap.lost for gap in gaps)
        beyond = 0 if end_report is None else max(0, end_report.ticks - known)
        return TickAccount(
            self._rows,
            None if self._first is None else self._first[0],
            None if self._first is None else self._latest[0],
            _period(self._first, self._latest),
            tuple(gaps),
            beyond,
            end_report,
        )


def account_ticks(blocks: Iterable[Records], end_report: EndReport | None) -> TickAccount:
    """Return the account of a record's rows, given in order, each tick once."""
    counter = TickCounter()
    for block in blocks:
        counter.add(block)
    return counter.result(end_report)


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
    missing = np.diff(ticks) - 1
    return [
        Gap(
            int(ticks[i]) + 1,
            int(ticks[i + 1]) - 1,
            _clamp(0, int(counted[i + 1] - counted[i]), int(missing[i])),
        )
        for i in np.flatnonzero(missing > 0).tolist()
    ]


def _clamp(low: int, value: int, high: int) -> int:
    return min(max(low, value), high)
