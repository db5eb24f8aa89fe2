"""The setup of a run, a snapshot of it, and its outcome."""

from pathlib import Path
from typing import Any, NamedTuple

from rig.processes.io_processes import IoProcess
from rig.realtime import cycle


class Setup(NamedTuple):
    """All that the supervisor needs to start a run."""

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
    supervisor_timeout: float  # s without a heartbeat of the supervisor after which the loop stops
    folder_lock: int = -1  # file descriptor, held as long as a process of the run lives; -1: none
    wire_locks: tuple[int, ...] = ()  # file descriptors, held by all that use wires or real time
    io_processes: tuple[IoProcess, ...] = ()
    law: str = ""  # for `rig.laws.from_request`; empty: the kind has no law to choose


class Snapshot(NamedTuple):
    """The present state of a run, for display."""

    row: dict[str, float | int]  # newest row by dotted field name; empty before the first
    dropped: int
    unsaved_rows: int  # rows in the ring that are not on disk yet
    problem: str  # with a process or the log; empty: none


class Outcome(NamedTuple):
    """The end of a run."""

    status: str  # complete, stopped, fault, crashed, refused
    reason: str  # name of rig.realtime.safety.Reason, or the last message of a process
    ticks: int
    skipped: int
    dropped: int  # rows the loop could not hand over
    unsaved: int  # rows handed over and not saved
    logger_restarts: int
    last_row: dict[str, float | int]
    died: str = ""  # the I/O process that died, with its last message; empty: none
    messages: tuple[str, ...] = ()  # of the I/O processes
    moved: str = ""  # why and where the record was moved during the run; empty: it was not
