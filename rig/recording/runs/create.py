"""Making a run: its folder, and its small JSON texts."""

import fcntl
import json
import os
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from rig.realtime.safety import Reason
from rig.recording.runs.folder import STATUS


class BusyError(RuntimeError):
    """Another run has what this one needs."""


def make(runs: Path, name: str, now: datetime) -> Path:
    """A new folder ``<UTC time>_<name>`` in ``runs``; two runs in one second get two folders."""
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


def ending(reason: Reason) -> str:
    """How a run ended, in one word, by the first reason of its stop."""
    if reason is Reason.PLAN_END:
        return "complete"
    if reason in (Reason.OPERATOR_STOP, Reason.OPERATOR_ABORT):
        return "stopped"
    return "crashed" if reason is Reason.NONE else "fault"


def write_json(folder: Path, name: str, value: Any) -> None:
    """Write a text so that a reader finds the old one or the new one, never half of it."""
    part = folder / f".{name}.new"
    part.write_text(json.dumps(value, indent=2, ensure_ascii=False) + "\n")
    part.replace(folder / name)


def note_rows(folder: Path, done: int) -> None:
    """Add to a run's status how many rows of its matrix are complete, for lists of runs.

    Raises OSError or ValueError where there is no status that can be read.
    """
    status = json.loads((folder / STATUS).read_text())
    write_json(folder, STATUS, status | {"rows_done": done})


class RunLock:
    """A lock on a run's folder, held until `close` and by every process that inherits it."""

    def __init__(self, fd: int) -> None:
        self.fd = fd

    def __enter__(self) -> "RunLock":
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self.fd)


def hold_run(folder: Path) -> RunLock:
    """Lock a run's folder against everybody else who would write to its record.

    BusyError if somebody has it: the run goes on, or another recovery is at work. Some network
    file systems know no such lock; there it is not held and nothing is said.
    """
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(fd)
        raise BusyError(f"{folder} is still being written") from None
    except OSError:
        pass
    return RunLock(fd)
