"""Making a run: its folder, its small JSON texts, its place on the real clock."""

import fcntl
import json
import os
import tempfile
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TextIO

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


def hold_realtime(campaign: str) -> TextIO:
    """Take the host's one real-time place for a campaign; BusyError names who has it.

    The real-time loop owns a core and the rig behind it. The lock goes with the process, so a
    killed run never blocks the next.
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
        raise BusyError(f"the real-time loop of this host is taken by {holder}") from None
    if file.writable():
        file.truncate(0)
        file.write(f"campaign {campaign}, process {os.getpid()}")
        file.flush()
    return file
