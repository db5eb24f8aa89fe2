"""Runs on disk: opening one as arrays, listing many, getting one back after a crash."""

from rig.recording.runs.folder import Facts, Listed, attachments, facts, files, list_runs
from rig.recording.runs.join import Joined, Salvaged, join, salvage
from rig.recording.runs.mcap_file import RunError
from rig.recording.runs.reader import open_run

__all__ = [
    "Facts",
    "Joined",
    "Listed",
    "RunError",
    "Salvaged",
    "attachments",
    "facts",
    "files",
    "join",
    "list_runs",
    "open_run",
    "salvage",
]
