"""State of a run's record: whether it holds every executed tick, and by whose report."""

import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from rig.recording.folder_watch import PROGRESS
from rig.recording.runs import folder
from rig.recording.runs.account import EndReport, TickAccount, TickCounter
from rig.recording.runs.mcap_file import FileContents, Records, merge_descriptions
from rig.regular_file import MAX_TABLE_BYTES, read_regular

COMPLETE, RECOVERED = "complete", "recovered"
LOOP = "the loop"  # as the source of its own end report
RECOVERY = "recovery.json"  # attachment of a file that was joined from parts
_MAX_SHOWN_GAPS = 5  # gaps named individually


class RecordState(NamedTuple):
    """The state of a record; it is independent of how the run ended."""

    state: str  # complete, recovered, unfinished, incomplete, damaged
    lost: int  # executed ticks known to have no row
    ticks: int  # executed ticks, as far as known
    missing: tuple[tuple[int, int], ...]  # first and last tick of each gap with lost rows
    damage: tuple[str, ...]
    at_least: bool  # the end was not observed: more rows may be lost

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
        shown = [f"{a} to {b}" if b > a else str(a) for a, b in self.missing[:_MAX_SHOWN_GAPS]]
        more = len(self.missing) - len(shown)
        return ", ".join([*shown, *([f"and {more} more gaps"] if more > 0 else [])])

    def attributes(self) -> dict[str, str]:
        """Return the state as flat attributes of a dataset."""
        found = {"record": self.description, "record_missing_ticks": self.spans}
        found["record_damage"] = "; ".join(self.damage)
        return {name: text for name, text in found.items() if text}

    @classmethod
    def from_dict(cls, data: dict[str, Any]) -> "RecordState":
        """Return the state from its plain data."""
        missing = tuple((int(a), int(b)) for a, b in data["missing_ticks"])
        damage = tuple(map(str, data["damage"]))
        count = int(data["lost"]), int(data["ticks"])
        return cls(str(data["state"]), *count, missing, damage, bool(data["at_least"]))

    def as_dict(self) -> dict[str, Any]:
        """Return the state as plain data."""
        return {
            "state": self.state,
            "description": self.description,
            "lost": self.lost,
            "ticks": self.ticks,
            "at_least": self.at_least,
            "missing_ticks": [list(gap) for gap in self.missing],
            "damage": list(self.damage),
        }


class RecordCheck:
    """Checks a record while its rows are read: counts ticks and collects damage.

    ``contents`` and ``damage``: results of the scan of its files.
    """

    def __init__(self, contents: Sequence[FileContents], damage: Iterable[str]) -> None:
        self._contents = contents
        self._counter = TickCounter()
        self.damage = list(damage)

    def add(self, block: Records) -> None:
        """Count the next rows, each tick once, in order."""
        self._counter.add(block)

    def state(self, run: str | os.PathLike[str]) -> RecordState:
        """Return the state of the run's record after all its rows were read."""
        place = Path(run)
        attachments, _ = merge_descriptions(self._contents)
        status, progress = logger_status(attachments), dict[str, Any]()
        if place.is_dir():
            status = read_json(place / folder.STATUS) or status
            progress = read_json(place / PROGRESS)
        running = status.get("status") == "running" and folder.is_supervised(status) is True
        report = None if running else end_report(status, progress, attachments)
        return state_of(
            self._counter.result(report),
            self.damage,
            finished=all(each.finished for each in self._contents),
            recovered="recovered_utc" in status,
            running=running,
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
        tuple((gap.first, gap.last) for gap in account.gaps if gap.lost),
        damage,
        open_end and not running,
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
