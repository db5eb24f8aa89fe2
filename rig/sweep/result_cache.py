"""Cache of a sweep's report and files, reused while its finished cases are unchanged."""

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rig.recording.runs.create import write_json
from rig.sweep.journal import JOURNAL_FILE as CASES

CACHE_FILE = "result_cache.json"


def store(
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


def load(folder: Path, out: Path) -> dict[str, Any] | None:
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
        "cases": hashlib.sha256((folder / CASES).read_bytes()).hexdigest(),
    }


def _file_stamps(files: Iterable[Path]) -> dict[str, list[int]]:
    """Return size and time of the last change (ns) of each file, by its absolute path."""
    stamps = {}
    for path in files:
        status = path.stat()
        stamps[str(path.resolve())] = [status.st_size, status.st_mtime_ns]
    return stamps
