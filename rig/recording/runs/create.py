"""Creation of a run: its folder and its small JSON files."""

import fcntl
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rig.realtime.reasons import STOPS_OF_PEOPLE, Reason
from rig.recording.folder_watch import open_folder
from rig.recording.journal import JOURNAL
from rig.recording.runs.folder import MCAP, RECOVERED, STATUS, earlier_records
from rig.regular_file import replacing


class BusyError(RuntimeError):
    """Another process uses the resource that this one needs."""


def create_folder(runs: Path, name: str, now: datetime) -> Path:
    """Create the folder ``<UTC time>_<name>`` in ``runs``; append a number if it exists."""
    stem = f"{now.astimezone(UTC):%Y%m%dT%H%M%SZ}_{name}"
    runs.mkdir(parents=True, exist_ok=True)
    for attempt in range(1, 1000):
        folder = runs / (stem if attempt == 1 else f"{stem}_{attempt}")
        try:
            folder.mkdir()
        except FileExistsError:
            continue
        return folder
    raise BusyError(f"{runs}: too many runs named {stem}")


def begin_stage(folder: Path) -> None:
    """Put the record of an ended run aside, so that the run can go on in the same folder.

    A crash in between leaves a folder that opens as before: the record has its new name, or the
    old one. Raise OSError if a file cannot be renamed.
    """
    stem = f"earlier-{1 + len(earlier_records(folder))}"
    record = folder / (RECOVERED if (folder / RECOVERED).exists() else MCAP)
    if record.exists():
        record.rename(folder / f"{stem}.mcap")
    else:  # killed before its first row
        stem = f"empty-{1 + len({path.name.partition('.')[0] for path in folder.glob('empty-*')})}"
    # What a crash or a damaged disk left, from which the record was recovered.
    for rest in sorted(folder.glob(f"{MCAP}*")):
        rest.rename(folder / f"{stem}.{rest.name}")
    with suppress(FileNotFoundError):
        (folder / JOURNAL).rename(folder / f"{stem}.{JOURNAL}")


def end_status(reason: int) -> str:
    """Return the status of a run by the number of its first stop reason, in one word."""
    if reason == Reason.PLAN_END:
        return "complete"
    if reason in STOPS_OF_PEOPLE:
        return "stopped"
    return "crashed" if reason == Reason.NONE else "fault"


def write_json(folder: Path, name: str, value: Any) -> None:
    """Write a JSON file as `replace_text` does."""
    replace_text(folder / name, json.dumps(value, indent=2, ensure_ascii=False) + "\n")


def replace_text(path: Path, text: str) -> None:
    """Write a file atomically: a reader finds the old or the new one, never a part of it.

    Raise OSError, on a full disk for example, and leave no partial file behind.
    """
    with replacing(path) as part:
        part.write_text(text, encoding="utf-8")


def write_rows_done(folder: Path, done: int) -> None:
    """Add the number of complete matrix rows to a run's status, for lists of runs.

    Raise OSError or ValueError without a readable status.
    """
    status = json.loads((folder / STATUS).read_text())
    write_json(folder, STATUS, status | {"rows_done": done})


@contextmanager
def lock_run(folder: Path) -> Iterator[int]:
    """Lock a run's folder against all other writers of its record; yield the descriptor.

    The lock is held until every process that inherits the descriptor has closed it. Raise BusyError
    if another process holds it: the run is going on, or another recovery is at work. Some network
    file systems have no such lock; there the function does nothing.
    """
    fd = open_folder(folder)
    try:
        with suppress(OSError):
            try:
                fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise BusyError(f"{folder} is still being written") from None
        yield fd
    finally:
        os.close(fd)
