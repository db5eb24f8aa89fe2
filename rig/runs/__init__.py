"""Runs on disk: opening one as arrays, listing many, getting one back after a crash."""

from rig.runs.folder import Facts, Listed, attachments, facts, files, list_runs
from rig.runs.mcap_file import RunError
from rig.runs.reader import open_run
from rig.runs.recover import Joined, Salvaged, join, salvage

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
