"""Messages between the processes of a run.

The supervisor sends a process its job as one text on standard input. The process sends reports, one
line of JSON each, on standard output: the name of the report's type and its fields.
"""

import json
import os
from contextlib import suppress
from typing import Any, NamedTuple, get_args

from rig.processes import handover
from rig.processes.handover import HandoverError
from rig.realtime import cycle
from rig.realtime.loop import LoopResult
from rig.realtime.scheduling import Privileges
from rig.recording.row_layout import RowSchema


class LoggerJob(NamedTuple):
    """The supervisor's request to the logger."""

    ring: int  # file descriptor
    rows: RowSchema  # of the ring's rows
    supervisor: int  # process id
    folder: str  # folder of the run
    folder_lock: int  # file descriptor of that folder
    part: str  # name of the file to create
    attachments: tuple[str, ...]  # files of the folder to attach to it
    run: str  # run id
    mode: str
    clock: str  # "virtual" or "real"
    rate_hz: float
    disk_timeout_s: float  # s of disk errors after which the remaining rows are lost


class LoopJob(NamedTuple):
    """The supervisor's request to the loop process."""

    real_clock: bool
    realtime_required: bool  # refuse to run without every privilege
    dt: float  # s
    ring: int  # file descriptor
    mailbox: int  # file descriptor
    supervisor: int  # process id
    params: cycle.Params
    devices: dict[str, Any]  # JSON values for the function that connects the devices
    supervisor_timeout: float  # s without a heartbeat of the supervisor after which the loop stops
    law: str = ""  # for `rig.laws.from_request`; empty: the kind has no law to choose
    logger: tuple[LoggerJob, ...] = ()  # the present logger's; none: unsaved rows are lost
    code: str = ""  # folder where the compiled tick is or will be; empty: it stays interpreted
    coupled: bool = False  # the ticks are compiled with the plant, whose code the process finds
    compiles: bool = False  # missing code is compiled beside the run
    live: int = -1  # file descriptor of the set points that people choose; -1: there are none


class CompileJob(NamedTuple):
    """The supervisor's request to the compiler of a tick."""

    params: cycle.Params
    dt: float  # s
    law: str  # as of `LoopJob`
    device_module: str = ""  # of the simulated plant with which ticks are coupled; empty: none
    devices: dict[str, Any] = {}  # JSON values for its `connect`  # noqa: RUF012


MessageFields = tuple[tuple[str, ...], ...]
"""Name and unit of each field of a message."""


class Slot(NamedTuple):
    """A mailbox that processes share."""

    fd: int
    fields: MessageFields  # of the message in it


class IoJob(NamedTuple):
    """The supervisor's request to an I/O process."""

    config: dict[str, Any]  # JSON values, read by the process's module
    mailboxes: dict[str, Slot]  # by name
    lifeline: int  # reading end of the pipe whose writing end only the loop holds


class LoopPrivileges(NamedTuple):
    """The loop has requested its privileges; none on the virtual clock."""

    privileges: tuple[Privileges, ...]


class CodeMissing(NamedTuple):
    """The loop runs interpreted until its ticks are compiled."""


class Compiled(NamedTuple):
    """The loop runs compiled from here on."""

    first_tick: int


class Refused(NamedTuple):
    """A process cannot begin its work, or go on with it."""

    why: str


class Ready(NamedTuple):
    """An I/O process is ready."""

    facts: dict[str, Any] = {}  # values read from the devices, for the loop  # noqa: RUF012


class Notice(NamedTuple):
    """A message of an I/O process for people."""

    text: str


class WireReport(NamedTuple):
    """The loop's summary of its wires, for the record."""

    values: dict[str, Any]  # JSON values


class DiskState(NamedTuple):
    """The logger's disk fails, or works again."""

    error: str  # empty: it works


class RecordLost(NamedTuple):
    """The logger's file is gone; it looks for another place."""

    why: str


class RecordMoved(NamedTuple):
    """The logger continues in another folder."""

    folder: str
    why: str


Report = (
    LoopPrivileges
    | LoopResult
    | WireReport
    | CodeMissing
    | Compiled
    | Refused
    | Ready
    | Notice
    | DiskState
    | RecordLost
    | RecordMoved
)
_REPORTS: dict[str, type] = {kind.__name__: kind for kind in get_args(Report)}


def report(message: Report) -> None:
    """Send a report to the supervisor; one that is gone is detected elsewhere."""
    line = memoryview(f"{json.dumps([type(message).__name__, message])}\n".encode())
    with suppress(OSError):
        while line:
            line = line[os.write(1, line) :]


def read_report(line: str) -> Report | None:
    """Return the report in a line; None for other text, which a library may print.

    Raises HandoverError for a report of an unknown type, or with missing or wrong fields.
    """
    try:
        value = json.loads(line)
    except ValueError:
        return None
    if not isinstance(value, list) or len(value) != 2 or not isinstance(value[0], str):
        return None
    name, fields = value
    if name not in _REPORTS:
        raise HandoverError(f"{name}: no such report; known are {', '.join(_REPORTS)}")
    found: Report = handover.build(_REPORTS[name], fields, name, {})
    return found
