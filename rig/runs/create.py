"""Making a run: its folder, its small JSON texts, its place on the real clock."""

import fcntl
import json
import os
import tempfile
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TextIO

from rig import process
from rig.runs.folder import PROGRESS, STATUS
from rig.safety import Reason


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


def note_progress(folder: Path, tick: int, skipped: int) -> None:
    """Note the newest tick and the periods skipped so far, for `rig recover` if all are killed.

    Written in place, a few bytes of one block: it costs no metadata and needs no room on a full
    disk. A failure is nobody's trouble: the record is what counts.
    """
    with suppress(OSError):
        fd = os.open(folder / PROGRESS, os.O_WRONLY | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            text = json.dumps({"last_tick": tick, "skipped": skipped})
            os.pwrite(fd, f"{text:<79}\n".encode(), 0)
        finally:
            os.close(fd)


class Held:
    """A lock on a run's folder, held until `close` and by every process that inherits it."""

    def __init__(self, fd: int) -> None:
        self.fd = fd

    def __enter__(self) -> "Held":
        return self

    def __exit__(self, *_: object) -> None:
        os.close(self.fd)


def hold_run(folder: Path) -> Held:
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
    return Held(fd)


def hold_realtime(campaign: str) -> TextIO:
    """Take the host's one real-time place for a campaign; BusyError names who has it.

    The real-time loop owns a core and the rig behind it. The lock goes with the processes that
    hold the file open, the loop among them: a killed run never blocks the next for longer than its
    loop takes to come to a stop.
    """
    path = Path(tempfile.gettempdir()) / "wec-rig-realtime.lock"
    try:
        file = os.fdopen(os.open(path, os.O_RDWR | os.O_CREAT, 0o666), "r+")
    except PermissionError:  # made by another user: it can be locked without being written
        file = path.open()
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = file.read().strip() or "another process"
        file.close()
        pid = holder.rpartition("process ")[2]
        if pid.isdigit() and process.started(int(pid)) is None:
            holder += ", which was killed; its loop is coming to a stop"
        raise BusyError(f"the real-time loop of this host is taken by {holder}") from None
    if file.writable():
        file.truncate(0)
        file.write(f"campaign {campaign}, process {os.getpid()}")
        file.flush()
    return file
