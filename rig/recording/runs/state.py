"""State of a run's record: which of its executed ticks it holds, and by whose report.

A period that the loop itself skipped (it woke too late) is counted in the next row, which separates
it from a lost row: of the ticks missing between two rows, the increase of the count
``timing.skipped`` were skipped.
"""

import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.recording.folder_watch import PROGRESS
from rig.recording.runs import folder
from rig.recording.runs.mcap_file import FileContents, Records, merge_descriptions
from rig.regular_file import MAX_TABLE_BYTES, read_regular

SKIPPED = "timing.skipped"
CHECKED_FIELDS = ("tick", "time", SKIPPED)  # that a check of a record uses, as far as it has them


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
        has_counts = SKIPPED in (block.dtype.names or ())
        counts: Any = block[SKIPPED] if has_counts else np.zeros(len(block), np.int64)
        self._gaps += _gaps(block["tick"], counts, self._tick, self._skipped)
        self._rows += len(block)
        self._tick = int(block["tick"][-1])
        self._skipped = int(counts[-1])
        self._latest = self._tick, float(block["time"][-1])

    @property
    def executed(self) -> int:
        """Number of ticks that the rows so far show to have been executed."""
        return self._rows + sum(gap.lost for gap in self._gaps)

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


def _gaps(ticks_read: Any, counts_read: Any, tick: int, skipped: int) -> list[Gap]:
    """Return the gaps between consecutive rows, the last row before them included."""
    ticks = np.concatenate(([tick], ticks_read.astype(np.int64)))
    counted = np.concatenate(([skipped], counts_read.astype(np.int64)))
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


COMPLETE, RECOVERED = "complete", "recovered"
LOOP = "the loop"  # as the source of its own end report
RECOVERY = "recovery.json"  # attachment of a file that was joined from parts
_MAX_SHOWN_GAPS = 5  # gaps named individually


class RecordState(NamedTuple):
    """The state of a record; it is independent of how the run ended."""

    state: str  # complete, recovered, unfinished, incomplete, damaged
    lost: int  # executed ticks known to have no row
    ticks: int  # executed ticks, as far as known
    at_least: bool  # the end was not observed: more rows may be lost
    missing_ticks: tuple[tuple[int, int], ...]  # first and last of each gap with lost rows
    damage: tuple[str, ...]

    @property
    def complete(self) -> bool:
        """Whether every known tick has its row."""
        return self.lost == 0 and not self.damage

    @property
    def description(self) -> str:
        """The state and the missing ticks as text."""
        text = self.state
        if self.lost:
            at_least = "at least " if self.at_least else ""
            text += f": {at_least}{self.lost} of {self.ticks} ticks missing"
            if spans := self.spans:
                text += f" ({spans})"
        elif self.damage:
            text += ": every known tick has its row"
        elif self.at_least:
            text += ": its end was not observed, rows may be missing there"
        return text

    @property
    def sentence(self) -> str:
        """The state, the missing ticks and the damage as a sentence without full stop."""
        return "; ".join([f"Record {self.description}", *self.damage])

    @property
    def spans(self) -> str:
        """The missing ticks as text."""
        shown = [
            f"{a} to {b}" if b > a else str(a) for a, b in self.missing_ticks[:_MAX_SHOWN_GAPS]
        ]
        more = len(self.missing_ticks) - len(shown)
        return ", ".join([*shown, *([f"and {more} more gaps"] if more > 0 else [])])

    def attributes(self) -> dict[str, str]:
        """Return the state as flat attributes of a dataset."""
        found = {"record": self.description, "record_missing_ticks": self.spans}
        found["record_damage"] = "; ".join(self.damage)
        return {name: text for name, text in found.items() if text}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> "RecordState":
        """Return the state from its plain data."""
        values = {name: data[name] for name in cls._fields}
        values |= {"missing_ticks": tuple(map(tuple, data["missing_ticks"]))}
        return cls(**values | {"damage": tuple(data["damage"])})

    def as_dict(self) -> dict[str, Any]:
        """Return the state as plain data."""
        return {"state": self.state, "description": self.description} | self._asdict()


class RecordCheck:
    """Checks a record while its rows are read: counts ticks and collects damage.

    ``contents`` and ``damage``: results of the scan of its files.
    """

    def __init__(self, contents: Sequence[FileContents], damage: Iterable[str]) -> None:
        self._contents = contents
        self._counter = TickCounter()
        self._stage = EndReport(0, 0, 0, "", final=False)  # counts before the last stage
        self.damage = list(damage)

    def begin_stage(self, first_tick: int, skipped: int) -> None:
        """Begin a stage of a resumed run, after ``skipped`` skipped ticks."""
        self._stage = EndReport(self._counter.executed, first_tick, skipped, "", final=False)

    def add(self, block: Records) -> None:
        """Count the next rows, each tick once, in order."""
        self._counter.add(block)

    def state(self, run: str | os.PathLike[str]) -> RecordState:
        """Return the state of the run's record after all its rows were read."""
        account, running, recovered = self._account(Path(run))
        return state_of(
            account,
            self.damage,
            finished=all(each.finished for each in self._contents),
            recovered=recovered,
            running=running,
        )

    def account(self, run: str | os.PathLike[str]) -> TickAccount:
        """Return the account of the run's ticks after all its rows were read."""
        return self._account(Path(run))[0]

    def _account(self, place: Path) -> tuple[TickAccount, bool, bool]:
        """Return the account, whether the run goes on, and whether it was recovered."""
        attachments, _ = merge_descriptions(self._contents)
        status, progress = logger_status(attachments), dict[str, Any]()
        if place.is_dir():
            status = read_json(place / folder.STATUS) or status
            progress = read_json(place / PROGRESS)
        running = status.get("status") == "running" and folder.is_supervised(status) is True
        report = None if running else end_report(status, progress, attachments)
        if report is not None:
            report = _in_ticks_of_run(report, self._stage)
        return self._counter.result(report), running, "recovered_utc" in status


def _in_ticks_of_run(report: EndReport, before: EndReport) -> EndReport:
    """Return the report on a stage's end with the counts before the stage added."""

    def add(count: int | None, earlier: int | None) -> int | None:
        return None if count is None else count + (earlier or 0)

    return report._replace(
        ticks=report.ticks + before.ticks,
        last_tick=add(report.last_tick, before.last_tick),
        skipped=add(report.skipped, before.skipped),
    )


def read_json(path: Path) -> dict[str, Any]:
    """Return a small JSON file; empty if it cannot be read."""
    with suppress(OSError):
        return folder.parse_json(read_regular(path, MAX_TABLE_BYTES))
    return {}


def state_of(
    account: TickAccount, damage: Iterable[str], *, finished: bool, recovered: bool, running: bool
) -> RecordState:
    """Return the state of a record from its account; ``finished``: its files were all finished."""
    damage = tuple(damage)
    final = account.end_report is not None and account.end_report.final
    open_end = not (final or (finished and not running))
    if damage:
        state = "damaged"
    elif account.lost:
        state = "incomplete"
    elif running:
        state = "being written"
    elif open_end:
        state = "unfinished"
    else:
        state = RECOVERED if recovered else COMPLETE
    return RecordState(
        state,
        account.lost,
        account.rows + account.lost,
        open_end and not running,
        tuple((gap.first, gap.last) for gap in account.gaps if gap.lost),
        damage,
    )


def end_report(
    status: dict[str, Any], progress: dict[str, Any], attachments: dict[str, bytes]
) -> EndReport | None:
    """Return the best report of the loop's end: by the supervisor, the loop, or a logger alone.

    If none of them survived, return what the supervisor wrote at most a tenth of a second earlier.
    """
    if status.get("status") != "running" and isinstance(status.get("ticks"), int):
        return EndReport(
            status["ticks"],
            _int_or_none(status.get("last_tick")),
            _int_or_none(status.get("skipped")),
            str(status.get("witness") or "the supervisor"),
            True,
        )
    last, skipped = _int_or_none(progress.get("last_tick")), _int_or_none(progress.get("skipped"))
    if progress.get("final") is True and isinstance(progress.get("ticks"), int):
        return EndReport(progress["ticks"], last, skipped, LOOP, True)
    last_log = logger_status(attachments)
    if isinstance(last_log.get("ticks"), int):
        return EndReport(last_log["ticks"], None, None, "the logger", True)
    if last is None or skipped is None:
        return None
    return EndReport(last + 1 - skipped, last, skipped, "the supervisor", False)


def logger_status(attachments: dict[str, bytes]) -> dict[str, Any]:
    """Return the last logger's report of the run's end; empty if it did not survive to it."""
    return folder.parse_json(attachments.get("status.json", b""))


def _int_or_none(value: Any) -> int | None:
    return value if isinstance(value, int) else None
