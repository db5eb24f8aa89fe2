"""What is to run, a run as it stands, and how it ended."""

from pathlib import Path
from typing import Any, NamedTuple

from rig.processes.io_processes import IoProcess
from rig.realtime import cycle


class Setup(NamedTuple):
    """What is to run."""

    kind_name: str
    kind: cycle.Kind
    params: cycle.Params
    loop_module: str  # python -m ...: the loop process with its devices
    devices: dict[str, Any]  # for that module's connect()
    dt: float  # s
    real_clock: bool
    realtime_required: bool
    folder: Path
    attachments: tuple[str, ...]  # JSON files of the folder that go into the MCAP file
    mode: str
    supervisor_timeout: float  # s without a sign of life of the supervisor that stop the loop
    folder_lock: int = -1  # file descriptor, held as long as anything of the run lives; -1: none
    wire_locks: tuple[int, ...] = ()  # file descriptors, held by all that use wires or real time
    io_processes: tuple[IoProcess, ...] = ()  # processes that serve the loop from beside it


class Snapshot(NamedTuple):
    """The run as it stands, for whoever draws it."""

    row: dict[str, float | int]  # newest row by dotted field name; empty before the first
    dropped: int
    behind: int  # rows in the ring that are not safe on disk yet
    trouble: str  # what is wrong with the log, empty if nothing


class Outcome(NamedTuple):
    """How the run ended."""

    status: str  # complete, stopped, fault, crashed, refused
    reason: str  # name of rig.realtime.safety.Reason, or what the process left as last words
    ticks: int
    skipped: int
    dropped: int  # rows the loop could not hand over
    unsaved: int  # rows handed over and not saved
    logger_restarts: int
    last_row: dict[str, float | int]
    died: str = ""  # which process beside the loop died, and its last words; empty: none
    messages: tuple[str, ...] = ()  # what those processes had to tell
    moved: str = ""  # why the record is not where it was begun, and where it is; empty: it is
