"""Execution of one task, a campaign or a session, from its parameters to the run's folder."""

import json
import math
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple, Protocol

from rig import module_process
from rig.processes import wire_locks
from rig.processes.run_types import ExecutionMode, Outcome, Snapshot, Task
from rig.processes.supervisor import SupervisedRun
from rig.processes.wire_locks import REALTIME_WIRE
from rig.realtime import safety
from rig.realtime.reasons import ReasonTable, reason_table
from rig.recording import provenance
from rig.recording.folder_watch import PROGRESS
from rig.recording.runs import JoinResult, RunError, create, join, reader
from rig.recording.runs.folder import LAW_SOURCE, MCAP, STATUS, mcap_parts

ATTACHED_FILES = ("config.json", "plan.json", "code.json", "host.json")

# Programs such as `timeout` signal a process and then its group; a person needs longer for a second
# Ctrl-C.
_ONE_REQUEST_S = 0.1


class View(Protocol):
    """A display of the run."""

    notice: str  # shown to people, e.g. after Ctrl-C

    def __call__(self, snapshot: Snapshot) -> None:
        """Draw the present state of the run."""


class RunResult(NamedTuple):
    """A finished run."""

    folder: Path
    outcome: Outcome
    save_error: str  # why files could not be written at the end; empty: all were written
    reasons: ReasonTable = reason_table()  # of a stop, of the kind of rig


def run_task(
    task: Task,
    runs: Path,
    view: View,
    mode: ExecutionMode,
    began: Callable[[Path], None] = lambda folder: None,
    resumed: Path | None = None,
) -> RunResult:
    """Run a task to its end and return the result; ``began`` is called with the folder.

    The folder is a new one in ``runs``, or that of an ended run which is ``resumed``. Raises
    BusyError when the real clock or one of its wires is taken, and RunError for a ``resumed`` run
    whose stages before have another execution mode. Ctrl-C requests a controlled stop,
    a second Ctrl-C an immediate power off; either way every row measured so far is kept.
    """
    with _requests_from_signals(view) as get_request, ExitStack() as locks:
        started = datetime.now(UTC)
        wires = (REALTIME_WIRE, *mode.wires) if mode.real_clock else mode.wires
        taken_locks = locks.enter_context(wire_locks.acquire(wires, f"campaign {task.name}"))
        folder = resumed or create.create_folder(runs, task.name, started)
        folder_lock = locks.enter_context(create.lock_run(folder))
        begin = {"started_utc": started.isoformat()}
        if resumed:
            begin = _begin_stage(folder, started, mode)
        status = _start_status(folder, task, mode) | begin
        _write_start_files(folder, task, status)
        began(folder)
        attached = (*ATTACHED_FILES, *([LAW_SOURCE] if task.law_source else []))
        run = SupervisedRun(
            task, mode, folder, attached, folder_lock=folder_lock, wire_locks=taken_locks.fds
        )
        outcome = run.supervise(_draw_until_error(view), get_request)
        if outcome.moved:  # some of the saved rows may be missing in the new folder
            lost = outcome.ticks - outcome.dropped - _count_readable_rows(run.folder)
            outcome = outcome._replace(unsaved=max(outcome.unsaved, lost))
        outcome, save_error = _close_folder(run.folder, task, outcome, status)
        with suppress(OSError, ValueError):
            # A folder from which only the record was removed refers to the record's folder.
            if run.folder != folder and (folder / STATUS).exists():
                status = json.loads((run.folder / STATUS).read_text())
                create.write_json(folder, STATUS, status | {"record_in": str(run.folder)})
    return RunResult(run.folder, outcome, save_error, task.kind.reason_table)


def _draw_until_error(view: View) -> Callable[[Snapshot], None]:
    """Return the view, silenced once drawing fails (a closed terminal): the run goes on."""
    broken = False

    def draw(snapshot: Snapshot) -> None:
        nonlocal broken
        if not broken:
            try:
                view(snapshot)
            except OSError:
                broken = True

    return draw


def _close_folder(
    folder: Path, task: Task, outcome: Outcome, start: dict[str, Any]
) -> tuple[Outcome, str]:
    """Write one finished record and the run's status; return the outcome and an error text.

    The outcome counts rows that the join lost as unsaved. The text names what failed, or is empty.
    A full disk must not hide how the run ended, so this function does not raise OSError.
    """
    outcome, record, record_error = _finish_record(folder, outcome)
    errors = [record_error] if record_error else []
    status = start | {
        "run": folder.name,
        "status": outcome.status,
        "reason": outcome.reason,
        "reason_text": task.kind.reason_table.text(outcome.reason),
        "ticks": outcome.ticks,
        "last_tick": outcome.last_row.get("tick"),
        "skipped": outcome.skipped,
        "dropped_rows": outcome.dropped,
        "unsaved_rows": outcome.unsaved,
        "logger_restarts": outcome.logger_restarts,
        "died": outcome.died,
        "messages": list(outcome.messages),
        "moved": outcome.moved,
        "compiled_from": outcome.compiled_from,
        "record": record,
        "ended_utc": datetime.now(UTC).isoformat(),
    }
    try:
        create.write_json(folder, STATUS, status)
        (folder / PROGRESS).unlink(missing_ok=True)
    except OSError as error:
        errors.append(f"{STATUS} lacks the end of the run: {_error_text(error)}")
    return outcome, "; ".join(errors)


def _finish_record(folder: Path, outcome: Outcome) -> tuple[Outcome, str, str]:
    """Join the record's parts; return the outcome, the record's state and an error text."""
    damage: tuple[str, ...] = ()
    record_error = ""
    if outcome.status == "refused" and not outcome.ticks:
        return outcome, "unfinished", ""  # no tick, so no row
    try:
        joined = _join_parts(folder)
        if joined is not None:
            damage = joined.damage
            missing = outcome.ticks - outcome.dropped - outcome.unsaved - joined.rows
            if missing > 0:
                outcome = outcome._replace(unsaved=outcome.unsaved + missing)
            if missing > 0 or damage:  # another attempt may read more rows
                why = "; ".join(damage) or "no part holds them"
                record_error = (
                    f"{MCAP} lacks {max(0, missing)} rows, its parts are kept in {folder}: {why}"
                )
            else:
                for part in mcap_parts(folder):
                    part.unlink()
    except (OSError, RunError) as error:
        record_error = (
            f"the parts of the record were not joined, use `rig recover`: {_error_text(error)}"
        )
        return outcome, "unfinished", record_error
    lost = outcome.dropped + outcome.unsaved
    if lost:
        return outcome, f"incomplete: {lost} of {outcome.ticks} ticks missing", record_error
    if damage:
        return outcome, "damaged: every known tick has its row", record_error
    return outcome, "complete", record_error


def _count_readable_rows(folder: Path) -> int:
    """Return the number of rows that can be read of the stage that has ended."""
    try:
        stage = reader.open_files(folder).stages[-1]
        return sum(len(block) for block in reader.stage_blocks(stage))
    except (OSError, RunError):
        return 0


def _error_text(error: Exception) -> str:
    return (isinstance(error, OSError) and error.strerror) or str(error)


def other_mode_text(run: Path, before: str, mode: str) -> str:
    """Return why a run of the execution mode ``before`` cannot go on in ``mode``."""
    return (
        f"{run.name}: its stages before ran in the mode {before}, this one would run in the mode "
        f"{mode}; one record has one mode: resume with the rig file and --sim as at its begin, or "
        "run the campaign anew"
    )


def _begin_stage(folder: Path, now: datetime, mode: ExecutionMode) -> dict[str, Any]:
    """Begin another stage of a run; return the times of its begin and of each later stage."""
    status = json.loads((folder / STATUS).read_text())
    if status["mode"] != mode.name:
        raise RunError(other_mode_text(folder, status["mode"], mode.name))
    create.begin_stage(folder)
    begun = [*status.get("resumed_utc", []), now.isoformat()]
    return {"started_utc": status["started_utc"], "resumed_utc": begun}


def _start_status(folder: Path, task: Task, mode: ExecutionMode) -> dict[str, Any]:
    return {
        "run": folder.name,
        "status": "running",
        "mode": mode.name,
        "kind": task.kind_name,
        "campaign": task.name,
        "rows_planned": task.planned_rows,
        "pid": os.getpid(),
        "pid_started": module_process.start_ticks(os.getpid()),
    }


def _write_start_files(folder: Path, task: Task, status: dict[str, Any]) -> None:
    (folder / "config.json").write_text(task.config + "\n")
    reasons = {"reasons": task.kind.reason_table.as_records()}
    create.write_json(folder, "plan.json", task.plan | reasons)
    if task.law_source:
        (folder / LAW_SOURCE).write_text(task.law_source)
    create.write_json(folder, "code.json", provenance.describe_code())
    create.write_json(folder, "host.json", provenance.describe_host())
    create.write_json(folder, STATUS, status)


def _join_parts(folder: Path) -> JoinResult | None:
    """Join the parts that killed loggers left to one file; None if the record is one already."""
    if (folder / MCAP).is_file():
        return None
    new = folder / f".{MCAP}.new"
    try:
        # A logger that was killed at its start leaves an empty file, which holds no row.
        joined = join([part for part in mcap_parts(folder) if part.stat().st_size], new)
    except OSError:
        new.unlink(missing_ok=True)
        raise
    new.rename(folder / MCAP)
    return joined


@contextmanager
def _requests_from_signals(view: View) -> Iterator[Callable[[], int]]:
    """Turn Ctrl-C, Ctrl-Z, termination and a closed terminal into requests; yield their reader.

    Ctrl-Z does not suspend the supervisor: suspended, it could not stop or watch the run. Signals
    belong to the main thread of a process: a run in another thread is stopped by `rig request`.
    """
    if threading.current_thread() is not threading.main_thread():
        yield lambda: safety.REQUEST_NONE
        return
    count, last = 0, -math.inf

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal count, last
        now = time.monotonic()
        if now - last < _ONE_REQUEST_S:
            return
        count, last = count + 1, now
        notice = "stopping: damping, then power off (Ctrl-C again: off at once)"
        if count > 1:
            notice = "power off; saving the measured rows"
        elif number == signal.SIGTSTP:
            notice = f"Ctrl-Z does not suspend a run: {notice}"
        view.notice = notice

    def get_request() -> int:
        return (safety.REQUEST_NONE, safety.REQUEST_STOP, safety.REQUEST_ABORT)[min(count, 2)]

    handled = [signal.SIGINT, signal.SIGTERM, signal.SIGTSTP]
    if signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:  # as nohup leaves it
        handled.append(signal.SIGHUP)
    before: dict[int, Any] = {number: signal.signal(number, interrupt) for number in handled}
    # In the background of a terminal with `tostop` set, drawing would suspend this process.
    before[signal.SIGTTOU] = signal.signal(signal.SIGTTOU, signal.SIG_IGN)
    try:
        yield get_request
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
