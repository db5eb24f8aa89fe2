"""What a sweep has finished, case by case, so that a killed one goes on where it was."""

import errno
import json
import os
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

from rig.sweep.cases import Outcome

NAME = "cases.jsonl"


class Journal:
    """A file of outcomes, one a line, of which one process at a time may be the writer."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / NAME
        self.finished: set[int] = set()  # numbers of the cases that gave something
        whole = 0
        for outcome, end in self._lines():
            whole = end
            if not outcome.failed:  # what failed may be tried again
                self.finished.add(outcome.case)
        self._file = self._path.open("ab", buffering=0)
        self.damaged = self._file.tell() - whole
        """Bytes that were no whole lines, cut off by a kill, say: their cases are run again."""
        self._file.truncate(whole)

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
        """Keep an outcome; a kill of this process does not lose it any more.

        Raises OSError, with the file's name, where there is no room for it.
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
        """All that was kept, read again from the file; the last of a case counts."""
        return (outcome for outcome, _ in self._lines())

    def _lines(self) -> Iterator[tuple[Outcome, int]]:
        """Every whole line and where it ends."""
        if not self._path.exists():
            return
        end = 0
        with self._path.open("rb") as file:
            for line in file:
                end += len(line)
                try:
                    told: dict[str, Any] = json.loads(line)
                    outcome = Outcome(**{**told, "rows": tuple(told["rows"])})
                except (ValueError, TypeError, KeyError):
                    return
                if not line.endswith(b"\n"):
                    return
                yield outcome, end
