"""One run of anything that has a plan: from its parameters to a folder with the record."""

import json
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple, Protocol

from rig.processes import wire_locks
from rig.processes.io_processes import IoProcess
from rig.processes.run_types import Outcome, Setup, Snapshot
from rig.processes.supervisor import Run
from rig.processes.wire_locks import REALTIME_PLACE, Wire
from rig.realtime import cycle, safety
from rig.recording import process_identity, provenance
from rig.recording.folder_watch import PROGRESS
from rig.recording.runs import JoinResult, RunError, create, join, reader
from rig.recording.runs.folder import MCAP, STATUS, mcap_parts

ATTACHED = ("config.json", "plan.json", "code.json", "host.json")


class Task(NamedTuple):
    """What is to be run, checked and planned."""

    name: str  # of the campaign or session, and so of the run's folder
    kind_name: str  # in `rig.kinds`
    kind: cycle.Kind
    params: cycle.Params
    dt: float  # s
    rows: int  # planned
    realtime_required: bool  # on the real clock
    supervisor_timeout: float  # s, of the rig file
    config: str  # JSON: the complete resolved configuration
    plan: dict[str, Any]  # what the run's folder says of the plan


class View(Protocol):
    """Who draws the run."""

    notice: str  # what was asked of the run, e.g. after Ctrl-C

    def __call__(self, snapshot: Snapshot) -> None:
        """Draw the run as it stands."""
        ...


class Ended(NamedTuple):
    """A run that has ended."""

    folder: Path
    outcome: Outcome
    trouble: str  # what could not be put on disk at the end; empty if nothing


class ExecutionMode(NamedTuple):
    """What a campaign is run on: nothing else differs between a rehearsal and the basin."""

    name: str  # rehearsal, hil, hardware
    real_clock: bool
    loop_module: str  # python -m ...: the loop process with its devices
    devices: dict[str, Any]  # for that module's connect()
    io_processes: tuple[IoProcess, ...] = ()
    wires: tuple[Wire, ...] = ()  # that its processes send on


def carry_out_task(task: Task, runs: Path, view: View, mode: ExecutionMode) -> Ended:
    """Run a task to its end; raises BusyError when the real clock or one of its wires is taken.

    Ctrl-C asks for a controlled stop, a second one for power off at once; either way every row
    measured so far is kept.
    """
    with _interrupts(view) as asked, ExitStack() as locks:
        started = datetime.now(UTC)
        wires = (REALTIME_PLACE, *mode.wires) if mode.real_clock else mode.wires
        taken = locks.enter_context(wire_locks.hold(wires, f"campaign {task.name}"))
        folder = create.create_folder(runs, task.name, started)
        held = locks.enter_context(create.lock_run(folder))
        _write_start(folder, task, started, mode)
        run = Run(
            Setup(
                task.kind_name,
                task.kind,
                task.params,
                mode.loop_module,
                mode.devices,
                task.dt,
                mode.real_clock,
                task.realtime_required and mode.real_clock,
                folder,
                ATTACHED,
                mode.name,
                task.supervisor_timeout,
                held.fd,
                taken.fds,
                mode.io_processes,
            )
        )
        outcome = run.supervise(_shown(view), asked)
        if outcome.moved:  # not all that was saved may have come along
            lost = outcome.ticks - outcome.dropped - _rows(run.folder)
            outcome = outcome._replace(unsaved=max(outcome.unsaved, lost))
        outcome, trouble = _close_folder(run.folder, task, outcome, started, mode)
        with suppress(OSError, ValueError):
            # Where only the record was taken away, the folder says where that is.
            if run.folder != folder and (folder / STATUS).exists():
                said = json.loads((run.folder / STATUS).read_text())
                create.write_json(folder, STATUS, said | {"record_in": str(run.folder)})
    return Ended(run.folder, outcome, trouble)


def _shown(view: View) -> Callable[[Snapshot], None]:
    """The view, until drawing fails (a closed terminal): a run does not end for that."""
    broken = False

    def watch(snapshot: Snapshot) -> None:
        nonlocal broken
        if not broken:
            try:
                view(snapshot)
            except OSError:
                broken = True

    return watch


def _close_folder(
    folder: Path, task: Task, outcome: Outcome, started: datetime, mode: ExecutionMode
) -> tuple[Outcome, str]:
    """Write one finished record and the run's status.

    Returns the outcome, rows that the join lost counted as unsaved, and what could not be done, in
    words. A full disk must not hide how the run ended, so nothing here raises for one.
    """
    outcome, record, failed = _finish_record(folder, outcome)
    trouble = [failed] if failed else []
    status = _status(folder, task, started, mode) | {
        "status": outcome.status,
        "reason": outcome.reason,
        "ticks": outcome.ticks,
        "last_tick": outcome.last_row.get("tick"),
        "skipped": outcome.skipped,
        "dropped_rows": outcome.dropped,
        "unsaved_rows": outcome.unsaved,
        "logger_restarts": outcome.logger_restarts,
        "died": outcome.died,
        "said": list(outcome.messages),
        "moved": outcome.moved,
        "record": record,
        "ended_utc": datetime.now(UTC).isoformat(),
    }
    try:
        create.write_json(folder, STATUS, status)
        (folder / PROGRESS).unlink(missing_ok=True)
    except OSError as error:
        trouble.append(f"{STATUS} does not tell how the run ended: {_why(error)}")
    return outcome, "; ".join(trouble)


def _finish_record(folder: Path, outcome: Outcome) -> tuple[Outcome, str, str]:
    """Make one file of the record; returns the outcome, the record's state and what failed."""
    damage: tuple[str, ...] = ()
    failed = ""
    try:
        joined = _join_parts(folder)
        if joined is not None:
            damage = joined.damage
            lacks = outcome.ticks - outcome.dropped - outcome.unsaved - joined.rows
            if lacks > 0:
                outcome = outcome._replace(unsaved=outcome.unsaved + lacks)
            if lacks > 0 or damage:  # another attempt may read more of them
                why = "; ".join(damage) or "no part holds them"
                failed = f"{MCAP} lacks {max(0, lacks)} rows, its parts are kept in {folder}: {why}"
            else:
                for part in mcap_parts(folder):
                    part.unlink()
    except (OSError, RunError) as error:
        failed = f"the record stays as its writers left it, `rig recover`: {_why(error)}"
        return outcome, "unfinished", failed
    lost = outcome.dropped + outcome.unsaved
    if lost:
        return outcome, f"incomplete: {lost} of {outcome.ticks} ticks missing", failed
    if damage:
        return outcome, "damaged: every tick that is known of has its row", failed
    return outcome, "complete", failed


def _rows(folder: Path) -> int:
    """Rows of a record that can be read."""
    try:
        state = reader.check_record(folder)
    except (OSError, RunError):
        return 0
    return state.ticks - state.lost


def _why(error: Exception) -> str:
    return (isinstance(error, OSError) and error.strerror) or str(error)


def _status(folder: Path, task: Task, started: datetime, mode: ExecutionMode) -> dict[str, Any]:
    return {
        "run": folder.name,
        "status": "running",
        "mode": mode.name,
        "kind": task.kind_name,
        "campaign": task.name,
        "rows_planned": task.rows,
        "started_utc": started.isoformat(),
        "pid": os.getpid(),
        "pid_started": process_identity.start_ticks(os.getpid()),
    }


def _write_start(folder: Path, task: Task, started: datetime, mode: ExecutionMode) -> None:
    (folder / "config.json").write_text(task.config + "\n")
    create.write_json(folder, "plan.json", task.plan)
    create.write_json(folder, "code.json", provenance.describe_code())
    create.write_json(folder, "host.json", provenance.describe_host())
    create.write_json(folder, STATUS, _status(folder, task, started, mode))


def _join_parts(folder: Path) -> JoinResult | None:
    """One file out of what killed loggers left; None if the record is one file already."""
    if (folder / MCAP).is_file():
        return None
    made = folder / f".{MCAP}.new"
    try:
        # A logger that was killed as it started leaves an empty file: nothing to join or to lose.
        joined = join([part for part in mcap_parts(folder) if part.stat().st_size], made)
    except OSError:
        made.unlink(missing_ok=True)
        raise
    made.rename(folder / MCAP)
    return joined


@contextmanager
def _interrupts(view: View) -> Iterator[Callable[[], int]]:
    """Ctrl-C, Ctrl-Z, termination and a closed terminal become requests; gives the one in force.

    A suspended supervisor could neither be asked for a stop nor look after anything.
    """
    count = 0

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal count
        count += 1
        notice = "stopping: damping, then power off (Ctrl-C again: off at once)"
        if count > 1:
            notice = "power off; saving what was measured"
        elif number == signal.SIGTSTP:
            notice = f"Ctrl-Z does not suspend a run: {notice}"
        view.notice = notice

    def asked() -> int:
        return (safety.REQUEST_NONE, safety.REQUEST_STOP, safety.REQUEST_ABORT)[min(count, 2)]

    asking = [signal.SIGINT, signal.SIGTERM, signal.SIGTSTP]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as nohup leaves it
        asking.append(signal.SIGHUP)
    before: dict[int, Any] = {number: signal.signal(number, interrupt) for number in asking}
    # In the background of a terminal that wants to be left alone, drawing would suspend us.
    before[signal.SIGTTOU] = signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
