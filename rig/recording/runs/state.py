"""Whether a run's record holds every tick that was executed, and who says how many those were."""

import json
import os
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from rig.recording.folder_watch import PROGRESS
from rig.recording.runs import folder
from rig.recording.runs.account import Account, Counting, Ending
from rig.recording.runs.mcap_file import Contents, Records
from rig.regular_file import MAX_TABLE_BYTES, read_regular

WHOLE, RECOVERED = "complete", "recovered"
LOOP = "the loop"  # as a witness of its own end
RECOVERY = "recovery.json"  # attachment of a file that was joined from parts
_SHOWN = 5  # gaps named one by one


class RecordState(NamedTuple):
    """The state of a record, which is another thing than how its run ended."""

    state: str  # complete, recovered, unfinished, incomplete, damaged
    lost: int  # executed ticks known to have no row
    ticks: int  # executed, as far as is known
    missing: tuple[tuple[int, int], ...]  # first and last tick of each gap with lost rows
    damage: tuple[str, ...]
    at_least: bool  # nobody saw the end: more rows may be lost

    @property
    def complete(self) -> bool:
        """Every tick that is known of has its row."""
        return self.lost == 0 and not self.damage

    @property
    def description(self) -> str:
        """The state with what is missing, in words."""
        said = self.state
        if self.lost:
            least = "at least " if self.at_least else ""
            said += f": {least}{self.lost} of {self.ticks} ticks missing"
            if spans := self.spans:
                said += f" ({spans})"
        elif self.damage:
            said += ": every tick that is known of has its row"
        elif self.at_least:
            said += ": nobody saw its end, rows may be missing there"
        return said

    @property
    def sentence(self) -> str:
        """The state with what is missing and what is damaged, without a full stop."""
        return "; ".join([f"Record {self.description}", *self.damage])

    @property
    def spans(self) -> str:
        """The missing ticks in words."""
        shown = [f"{a} to {b}" if b > a else str(a) for a, b in self.missing[:_SHOWN]]
        more = len(self.missing) - len(shown)
        return ", ".join([*shown, *([f"and {more} more gaps"] if more > 0 else [])])

    def attributes(self) -> dict[str, str]:
        """The same as flat attributes of a dataset."""
        found = {"record": self.description, "record_missing_ticks": self.spans}
        found["record_damage"] = "; ".join(self.damage)
        return {name: text for name, text in found.items() if text}

    @classmethod
    def of(cls, data: dict[str, Any]) -> "RecordState":
        """The state from its plain data."""
        missing = tuple((int(a), int(b)) for a, b in data["missing_ticks"])
        damage = tuple(map(str, data["damage"]))
        count = int(data["lost"]), int(data["ticks"])
        return cls(str(data["state"]), *count, missing, damage, bool(data["at_least"]))

    def as_dict(self) -> dict[str, Any]:
        """As plain data."""
        return {
            "state": self.state,
            "words": self.description,
            "lost": self.lost,
            "ticks": self.ticks,
            "at_least": self.at_least,
            "missing_ticks": [list(gap) for gap in self.missing],
            "damage": list(self.damage),
        }


class Reading:
    """What is seen of a record while its rows are read: its ticks, and what is damaged."""

    def __init__(self, contents: Sequence[Contents], damage: Iterable[str] = ()) -> None:
        self._contents = contents
        self._counting = Counting()
        self.damage = [*damage, *(text for each in contents for text in each.damage)]

    def add(self, block: Records) -> None:
        """Count the next rows, each tick once, in order."""
        self._counting.add(block)

    def state(self, run: str | os.PathLike[str]) -> RecordState:
        """The state of the run's record, once all its rows were read."""
        place = Path(run)
        attachments: dict[str, bytes] = {}
        for each in self._contents:
            attachments.update(each.attachments)
        status, progress = logged(attachments), dict[str, Any]()
        if place.is_dir():
            status = text_of(place / folder.STATUS) or status
            progress = text_of(place / PROGRESS)
        running = status.get("status") == "running" and folder.supervised(status) is True
        ending = None if running else ending_of(status, progress, attachments)
        return state_of(
            self._counting.result(ending),
            self.damage,
            finished=all(each.finished for each in self._contents),
            recovered="recovered_utc" in status,
            running=running,
        )


def text_of(path: Path) -> dict[str, Any]:
    """A small JSON text; empty where there is none that can be read."""
    with suppress(OSError, ValueError):
        value = json.loads(read_regular(path, MAX_TABLE_BYTES))
        return value if isinstance(value, dict) else {}
    return {}


def state_of(
    counted: Account, damage: Iterable[str], *, finished: bool, recovered: bool, running: bool
) -> RecordState:
    """The state of a record from its account; ``finished``: its writers ended all its files."""
    damage = tuple(damage)
    final = counted.ending is not None and counted.ending.final
    open_end = not (final or (finished and not running))
    if damage:
        state = "damaged"
    elif counted.lost:
        state = "incomplete"
    elif running:
        state = "being written"
    elif open_end:
        state = "unfinished"
    else:
        state = RECOVERED if recovered else WHOLE
    return RecordState(
        state,
        counted.lost,
        counted.rows + counted.lost,
        tuple((gap.first, gap.last) for gap in counted.gaps if gap.lost),
        damage,
        open_end and not running,
    )


def ending_of(
    status: dict[str, Any], progress: dict[str, Any], attachments: dict[str, bytes]
) -> Ending | None:
    """Who saw the loop end: the supervisor, the loop itself, or a logger left to itself.

    If none lived so long, what the supervisor noted a tenth of a second before or less.
    """
    if status.get("status") != "running" and isinstance(status.get("ticks"), int):
        return Ending(
            status["ticks"],
            _whole(status.get("last_tick")),
            _whole(status.get("skipped")),
            str(status.get("witness") or "the supervisor"),
            True,
        )
    if progress.get("final") is True and isinstance(progress.get("ticks"), int):
        last, skipped = _whole(progress.get("last_tick")), _whole(progress.get("skipped"))
        return Ending(progress["ticks"], last, skipped, LOOP, True)
    told = logged(attachments)
    if isinstance(told.get("ticks"), int):
        return Ending(told["ticks"], None, None, "the logger", True)
    last, skipped = _whole(progress.get("last_tick")), _whole(progress.get("skipped"))
    if last is None or skipped is None:
        return None
    return Ending(last + 1 - skipped, last, skipped, "the supervisor", False)


def logged(attachments: dict[str, bytes]) -> dict[str, Any]:
    """What the last logger wrote of the run's end; empty if it did not live to see it."""
    with suppress(ValueError):
        told = json.loads(attachments.get("status.json", b""))
        return told if isinstance(told, dict) else {}
    return {}


def _whole(value: Any) -> int | None:
    return value if isinstance(value, int) else None
