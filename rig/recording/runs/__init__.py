"""Runs on disk: opening one as arrays, listing many, recovering one after a crash."""

from rig.recording.runs.folder import (
    RunInfo,
    RunListEntry,
    attachments,
    list_runs,
    mcap_files,
    run_info,
)
from rig.recording.runs.mcap_records import RunError
from rig.recording.runs.reader import open_run
from rig.recording.runs.recover import JoinResult, join

__all__ = [
    "JoinResult",
    "RunError",
    "RunInfo",
    "RunListEntry",
    "attachments",
    "join",
    "list_runs",
    "mcap_files",
    "open_run",
    "run_info",
]
