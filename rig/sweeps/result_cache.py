"""Files of a sweep's folder: the journal of its finished cases, and the report of its result.

A killed sweep resumes with the journal. The report is reused while the finished cases are
unchanged.
"""

import errno
import hashlib
import json
import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from rig.recording.runs.create import write_json
from rig.sweeps.cases import Outcome

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

    def __exit__(self, *_: object) -> None:
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


CACHE_FILE = "result_cache.json"


def store_report(
    folder: Path, out: Path, measured: Path | None, files: Iterable[Path], report: dict[str, Any]
) -> None:
    """Store the report of a sweep with result ``out``, and the ``files`` it wrote.

    ``measured`` is the run drawn on top of the figures. Raises OSError if a file is missing.
    """
    fingerprint = _fingerprint(folder, out, measured)
    write_json(
        folder,
        CACHE_FILE,
        {"fingerprint": fingerprint, "files": _file_stamps(files), "report": report},
    )


def load_report(folder: Path, out: Path) -> dict[str, Any] | None:
    """Return the stored report if cases and files are unchanged; None if it must be made again.

    Code, campaign and values need no check, because the folder is named by them. A report with a
    measured run on top is never reused, nor is one whose files are missing or were changed.
    """
    try:
        entry = json.loads((folder / CACHE_FILE).read_text())
        is_current = entry["fingerprint"] == _fingerprint(folder, out, None)
        report: dict[str, Any] = entry["report"]
        files = entry["files"]
        return report if is_current and files == _file_stamps(map(Path, files)) else None
    except (OSError, ValueError, TypeError, KeyError):
        return None


def _fingerprint(folder: Path, out: Path, measured: Path | None) -> dict[str, Any]:
    return {
        "folder": str(folder),  # as given on the command line: the report names its files by it
        "out": str(out.resolve()),  # a relative path depends on the working directory
        "measured": str(measured) if measured else None,
        "cases": hashlib.sha256((folder / JOURNAL_FILE).read_bytes()).hexdigest(),
    }


def _file_stamps(files: Iterable[Path]) -> dict[str, list[int]]:
    """Return size and time of the last change (ns) of each file, by its absolute path."""
    stamps = {}
    for path in files:
        status = path.stat()
        stamps[str(path.resolve())] = [status.st_size, status.st_mtime_ns]
    return stamps
