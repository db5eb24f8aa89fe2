"""One run of anything that has a plan: from its parameters to a folder with the record."""

import os
import signal
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple, Protocol

from rig import cycle, process, provenance, safety
from rig.companions import Companion
from rig.runs import RunError, create, join
from rig.runs.folder import MCAP, PROGRESS, STATUS, files
from rig.supervisor import Outcome, Run, Setup, Snapshot

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


class Rung(NamedTuple):
    """What a campaign is run on: nothing else differs between a rehearsal and the basin."""

    name: str  # rehearsal, hil, hardware
    real_clock: bool
    loop_module: str  # python -m ...: the loop process with its devices
    devices: dict[str, Any]  # for that module's connect()
    companions: tuple[Companion, ...] = ()


def carry_out_task(task: Task, runs: Path, view: View, rung: Rung) -> Ended:
    """Run a task to its end; raises BusyError when the real clock is taken.

    Ctrl-C asks for a controlled stop, a second one for power off at once; either way every row
    measured so far is kept.
    """
    with _interrupts(view) as asked, ExitStack() as locks:
        started = datetime.now(UTC)
        realtime = -1
        if rung.real_clock:
            realtime = locks.enter_context(create.hold_realtime(task.name)).fileno()
        folder = create.make(runs, task.name, started)
        held = locks.enter_context(create.hold_run(folder))
        _write_start(folder, task, started, rung)
        run = Run(
            Setup(
                task.kind_name,
                task.kind,
                task.params,
                rung.loop_module,
                rung.devices,
                task.dt,
                rung.real_clock,
                task.realtime_required and rung.real_clock,
                folder,
                ATTACHED,
                rung.name,
                held.fd,
                realtime,
                rung.companions,
            )
        )
        outcome = run.supervise(_shown(view), asked)
        trouble = _close_folder(folder, task, outcome, started, rung)
    return Ended(folder, outcome, trouble)


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


def _close_folder(folder: Path, task: Task, outcome: Outcome, started: datetime, rung: Rung) -> str:
    """One finished record and the run's status; what could not be done, in words.

    A full disk must not hide how the run ended, so nothing here raises for one.
    """
    trouble = []
    status = _status(folder, task, started, rung) | {
        "status": outcome.status,
        "reason": outcome.reason,
        "ticks": outcome.ticks,
        "last_tick": outcome.last_row.get("tick"),
        "skipped": outcome.skipped,
        "dropped_rows": outcome.dropped,
        "unsaved_rows": outcome.unsaved,
        "logger_restarts": outcome.logger_restarts,
        "died": outcome.died,
        "said": list(outcome.said),
        "ended_utc": datetime.now(UTC).isoformat(),
    }
    try:
        _join_parts(folder)
    except (OSError, RunError) as error:
        trouble.append(f"the record stays as its writers left it, `rig recover`: {_why(error)}")
    try:
        create.write_json(folder, STATUS, status)
        (folder / PROGRESS).unlink(missing_ok=True)
    except OSError as error:
        trouble.append(f"{STATUS} does not tell how the run ended: {_why(error)}")
    return "; ".join(trouble)


def _why(error: Exception) -> str:
    return (isinstance(error, OSError) and error.strerror) or str(error)


def _status(folder: Path, task: Task, started: datetime, rung: Rung) -> dict[str, Any]:
    return {
        "run": folder.name,
        "status": "running",
        "rung": rung.name,
        "kind": task.kind_name,
        "campaign": task.name,
        "rows_planned": task.rows,
        "started_utc": started.isoformat(),
        "pid": os.getpid(),
        "pid_started": process.started(os.getpid()),
    }


def _write_start(folder: Path, task: Task, started: datetime, rung: Rung) -> None:
    (folder / "config.json").write_text(task.config + "\n")
    create.write_json(folder, "plan.json", task.plan)
    create.write_json(folder, "code.json", provenance.code())
    create.write_json(folder, "host.json", provenance.host())
    create.write_json(folder, STATUS, _status(folder, task, started, rung))


def _join_parts(folder: Path) -> None:
    """One file out of what killed loggers left; the parts stay if they cannot be joined."""
    parts = files(folder)
    whole = folder / MCAP
    if whole in parts:
        return
    made = folder / f".{MCAP}.new"
    try:
        join(parts, made)
    except OSError:
        made.unlink(missing_ok=True)
        raise
    made.rename(whole)
    for part in parts:
        part.unlink()


@contextmanager
def _interrupts(view: View) -> Iterator[Callable[[], int]]:
    """Ctrl-C, termination and a closed terminal become requests; gives what is asked so far."""
    count = 0

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal count
        count += 1
        view.notice = (
            "stopping: damping, then power off (Ctrl-C again: off at once)"
            if count == 1
            else "power off; saving what was measured"
        )

    def asked() -> int:
        return (safety.REQUEST_NONE, safety.REQUEST_STOP, safety.REQUEST_ABORT)[min(count, 2)]

    asking = [signal.SIGINT, signal.SIGTERM]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as nohup leaves it
        asking.append(signal.SIGHUP)
    before = {number: signal.signal(number, interrupt) for number in asking}
    try:
        yield asked
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
