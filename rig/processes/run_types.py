"""A task to run, the mode in which it runs, a snapshot of the run, and its outcome."""

from typing import Any, NamedTuple

from rig.people.orders import People
from rig.processes.io_processes import IoProcess
from rig.processes.wire_locks import Wire
from rig.realtime import cycle


class Task(NamedTuple):
    """A checked and planned campaign or session."""

    name: str  # of the campaign or session, and so of the run's folder
    kind_name: str  # of the rig, in `rig.kinds.registry`
    tick: str  # package of the kind's tick, whose find_kind() returns `kind`
    kind: cycle.Kind
    params: cycle.Params
    dt: float  # s
    planned_rows: int
    realtime_required: bool  # on the real clock
    supervisor_timeout: float  # s without a heartbeat of the supervisor until the loop stops
    config: str  # JSON: the complete resolved configuration
    plan: dict[str, Any]  # JSON values for `plan.json` in the run's folder
    law: str = ""  # for `rig.laws.from_request`; empty: the kind has no law to choose
    law_source: str = ""  # of a law that is given by its file, for `law.py`
    people: People = People()  # how they may act on the run


class RecordedTask(NamedTuple):
    """The task of a recorded run, as today's code builds it from the record."""

    kind: cycle.Kind
    params: cycle.Params
    dt: float  # s
    notice: str = ""  # how the law of today differs from that of the run; empty: it does not
    sense: Any = None  # type of the sense where it depends on the rig file; None: the tick's own
    sense_in_row: dict[str, str] | None = None  # its fields that have another name in a row
    law: str = ""  # as of `Task`


class ExecutionMode(NamedTuple):
    """The processes, devices and clock of a run; nothing else differs between the modes."""

    name: str  # rehearsal, hil, hardware
    real_clock: bool
    device_module: str  # whose connect() returns the loop's devices
    devices: dict[str, Any]  # JSON values for connect()
    io_processes: tuple[IoProcess, ...] = ()
    wires: tuple[Wire, ...] = ()  # on which its processes send
    interpreted: bool = False  # never run the tick compiled
    coupled: bool = False  # ticks may be compiled together with the simulated plant


class Snapshot(NamedTuple):
    """The present state of a run, for display."""

    row: dict[str, float | int]  # newest row by dotted field name; empty before the first
    dropped: int
    unsaved_rows: int  # rows in the ring that are not on disk yet
    problem: str  # with a process or the log; empty: none
    reason: str = ""  # name of the reason of a stop, in the newest row
    people: dict[str, Any] = {}  # noqa: RUF012  (`rig.people.orders.Orders.describe`)
    compiling: bool = False  # the tick runs interpreted until it is compiled


class Outcome(NamedTuple):
    """The end of a run."""

    status: str  # complete, stopped, fault, crashed, refused
    reason: str  # name in the kind's table of reasons, or the last message of a process
    ticks: int
    skipped: int
    dropped: int  # rows the loop could not hand over
    unsaved: int  # rows handed over and not saved
    logger_restarts: int
    last_row: dict[str, float | int]
    died: str = ""  # the I/O process that died, with its last message; empty: none
    messages: tuple[str, ...] = ()  # of the I/O processes
    moved: str = ""  # why and where the record was moved during the run; empty: it was not
    compiled_from: int = -1  # first tick that ran compiled; -1: all ran interpreted
