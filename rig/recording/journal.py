"""The journal of a run: every request of people, who made it, and whether it was carried out.

A text file of the run's folder, one JSON object a line, each on disk before the request acts; the
MCAP file has it as an attachment. The numbers of the set points that people chose are in it, so a
replay of the run gives them to the loop again.
"""

import json
import os
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from rig import finite_json

JOURNAL = "requests.jsonl"


class Entry(NamedTuple):
    """A request and the answer to it."""

    utc: str  # ISO 8601
    tick: int  # newest tick when the request came; -1: before the first
    person: str  # name of the user
    origin: str  # terminal, command, page, campaign, supervisor
    request: str  # stop, hold, set, ...
    arguments: dict[str, Any] = {}  # noqa: RUF012
    accepted: bool = True
    reason: str = ""  # why it was refused, or what it led to
    number: int = 0  # of the set point; 0: the request has none
    numbers: Sequence[float] = ()  # of the set point, one for each column of the kind's table


class Journal:
    """Appends entries to the journal of a run."""

    def __init__(self, folder: Callable[[], Path]) -> None:
        """``folder`` returns the folder in which the record is now."""
        self._folder = folder
        self._entries: list[bytes] = []  # all so far: a record that moves takes them with it
        self._lock = threading.Lock()
        self.problem = ""  # why the last entry is not on disk

    def add(self, entry: Entry) -> bool:
        """Append an entry and wait until it is on disk; return False if that failed."""
        line = finite_json.dumps(entry._asdict(), ensure_ascii=False) + "\n"
        text = line.encode("utf-8", "backslashreplace")  # which for half a character is JSON, too
        with self._lock:
            return self._append(text)

    def follow_record(self) -> None:
        """Write the entries so far into a folder to which the record has moved.

        A thread of its own does so: the caller must not wait for the disk that failed.
        """
        threading.Thread(target=self._follow, name="journal", daemon=True).start()

    def _follow(self) -> None:
        with self._lock:
            if self._entries:
                self._append(b"")

    def _append(self, text: bytes) -> bool:
        try:
            path = self._folder() / JOURNAL
            written = text if path.exists() else b"".join((*self._entries, text))
            descriptor = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o644)
            try:
                if os.write(descriptor, written) != len(written):
                    raise OSError("no space left for a whole line")
                os.fdatasync(descriptor)
            finally:
                os.close(descriptor)
        except OSError as error:
            self.problem = f"{JOURNAL}: {error.strerror or error}"
            return False
        self.problem = ""
        if text:
            self._entries.append(text)
        return True

    def add_later(self, entry: Entry) -> None:
        """Append an entry from a thread of its own, for a caller that must not wait for a disk."""
        threading.Thread(target=self.add, args=(entry,), name="journal", daemon=True).start()


def read_journal(text: bytes) -> Iterator[Entry]:
    """Yield the entries of a journal; lines that are not whole (a full disk) are left out.

    Earlier journals may have NaN in the arguments of a refused request.
    """
    for line in text.splitlines():
        try:
            yield Entry(**json.loads(line))
        except (ValueError, TypeError):
            continue
