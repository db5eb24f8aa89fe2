"""Journal of a sweep's finished cases, with which a killed sweep resumes."""

import errno
import json
import os
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

from rig.sweep.cases import Outcome

JOURNAL_FILE = "cases.jsonl"


class Journal:
    """A file of outcomes, one per line; only one process at a time may write it."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / JOURNAL_FILE
        self.finished: set[int] = set()  # numbers of the cases that succeeded
        valid_end = 0
        for outcome, end in self._lines():
            valid_end = end
            if not outcome.failed:  # failed cases are run again
                self.finished.add(outcome.case)
        self._file = self._path.open("ab", buffering=0)
        self.damaged_bytes = self._file.tell() - valid_end
        """Bytes after the last complete line, as after a kill: cut off, their cases run again."""
        self._file.truncate(valid_end)

    def __enter__(self) -> "Journal":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._file.close()

    def add(self, outcome: Outcome) -> None:
        """Write an outcome to the file; a kill of this process no longer loses it.

        Raises OSError with the file's name if the disk is full.
        """
        line = json.dumps(outcome._asdict()).encode() + b"\n"
        try:
            if self._file.write(line) != len(line):
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self._path)) from None
        if not outcome.failed:
            self.finished.add(outcome.case)

    def outcomes(self) -> Iterator[Outcome]:
        """Yield all outcomes from the file in order; the last outcome of a case is valid."""
        return (outcome for outcome, _ in self._lines())

    def _lines(self) -> Iterator[tuple[Outcome, int]]:
        """Yield the outcome of every complete line and the position of its end."""
        if not self._path.exists():
            return
        end = 0
        with self._path.open("rb") as file:
            for line in file:
                end += len(line)
                try:
                    fields: dict[str, Any] = json.loads(line)
                    outcome = Outcome(**{**fields, "rows": tuple(fields["rows"])})
                except (ValueError, TypeError, KeyError):
                    return
                if not line.endswith(b"\n"):
                    return
                yield outcome, end
