"""The supervisor, which starts logger and loop, watches both, and brings a run to its end.

The supervisor never touches a device. Its requests reach the loop through the mailbox; its display
shows the newest row in the ring. The logger starts before the loop and outlives it, and both
outlive the supervisor. If the supervisor dies, or its heartbeat is too old, the loop stops by
itself and the logger saves the remaining rows.

The thread that posts the heartbeat waits neither for a terminal nor for a disk: both can block for
longer than the loop's heartbeat time-out. Another thread draws (`drawing_thread`).
"""

import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from rig.people.orders import Orders
from rig.people.request_socket import RequestServer
from rig.processes import handover, mailbox
from rig.processes import logger as log_process
from rig.processes.child import Child, StallTimer
from rig.processes.io_processes import IoProcessError, IoProcesses
from rig.processes.mailbox import Mailbox, SupervisorMessage, live_setpoint_type
from rig.processes.messages import (
    CodeMissing,
    Compiled,
    DiskState,
    LoggerJob,
    LoopJob,
    LoopPrivileges,
    RecordLost,
    RecordMoved,
    Refused,
    WireReport,
)
from rig.processes.not_finite import ROWS, first_not_finite
from rig.processes.run_types import ExecutionMode, Outcome, Snapshot, Task
from rig.processes.tick_compiler import TickCompiler
from rig.realtime import safety
from rig.realtime.live_setpoints import live_columns
from rig.realtime.loop import LoopResult
from rig.realtime.reasons import NO_REASON, Reason
from rig.realtime.requests import NO_REQUEST
from rig.realtime.sequence import CHOICE
from rig.recording import ring
from rig.recording.folder_watch import FolderTracker, refers_to, write_progress
from rig.recording.journal import Journal
from rig.recording.row_layout import layout, leaves, schema
from rig.recording.runs.create import end_status, write_json
from rig.recording.runs.folder import MCAP

_FINAL_DRAW_TIMEOUT_S = 5.0  # s that the last drawing may take

T = TypeVar("T")


@contextmanager
def drawing_thread(draw: Callable[[T], None]) -> Iterator[Callable[[T], None]]:
    """Draw values in a thread of their own; yield the function that takes the newest value.

    The function returns at once, or raises the error of an earlier drawing; older values that were
    not drawn are skipped. Leaving the context waits until the last value is drawn, but not for a
    terminal that blocks.
    """
    changed = threading.Condition()
    newest: list[T] = []
    errors: list[BaseException] = []
    ended = False

    def run() -> None:
        while True:
            with changed:
                changed.wait_for(lambda: newest or ended)
                if not newest:
                    return
                value = newest.pop()
            try:
                draw(value)
            except BaseException as error:  # noqa: BLE001  (`show` raises it)
                errors.append(error)
                return

    def show(value: T) -> None:
        if errors:
            raise errors[0]
        with changed:
            newest[:] = [value]
            changed.notify()

    # A daemon thread: a terminal that blocks for ever must not keep the process alive.
    thread = threading.Thread(target=run, name="display", daemon=True)
    thread.start()
    try:
        yield show
    finally:
        with changed:
            ended = True
            changed.notify()
        thread.join(_FINAL_DRAW_TIMEOUT_S)
    if errors:
        raise errors[0]


LOOP_MODULE = "rig.processes.loop_process"
POLL_INTERVAL_S = 0.1  # s between two polls of the processes
MAX_LOGGER_RESTARTS = 5  # of a killed logger in one run
DISK_TIMEOUT_S = 20.0  # s of retries on a failing disk before the rest of the log is abandoned
STALL_TIMEOUT_S = 60.0  # s without a saved row, or without an end, until the logger is restarted
HANG_TIMEOUT_S = 10.0  # s without a tick after which the loop is killed
ABORT_TIMEOUT_S = 5.0  # s that the loop may take to carry out an abort


WIRES_FILE = "wires.json"  # in the run's folder: what the loop reports of its wires


class SupervisedRun:
    """One run and its supervision; call `supervise` once.

    ``attachments``: JSON files of the folder that go into the MCAP file; ``folder_lock``: file
    descriptor, held as long as a process of the run lives; ``wire_locks``: file descriptors, held
    by all that use wires or real time.
    """

    def __init__(
        self,
        task: Task,
        mode: ExecutionMode,
        folder: Path,
        attachments: tuple[str, ...],
        *,
        folder_lock: int,
        wire_locks: tuple[int, ...],
    ) -> None:
        self._task, self._mode = task, mode
        self._run, self._attachments = folder.name, attachments
        self._folder_lock, self._wire_locks = folder_lock, wire_locks
        self._reasons = task.kind.reason_table
        self._ring_fd = ring.create(task.kind.row_type, _ring_capacity(task.dt))
        self._mailbox_fd = mailbox.create()
        self._ring = ring.RingReader(self._ring_fd)
        self._mailbox = Mailbox(self._mailbox_fd, SupervisorMessage)
        self._live_fd = mailbox.create()
        self._live_type = live_setpoint_type(live_columns(task.params))
        self._live = Mailbox(self._live_fd, self._live_type)
        self._woken = threading.Event()
        self._journal = Journal(lambda: self.folder)
        self._orders = Orders(task.params.segments, task.people, self._journal, self._woken.set)
        self._server: RequestServer | None = None
        self._layout = layout(task.kind.row_type)
        self._units = {leaf.name: leaf.unit for leaf in leaves(task.kind.row_type)}
        self._names = list(self._units)
        self._io_processes = IoProcesses(mode.io_processes, folder, wire_locks)
        self._compiler: TickCompiler | None = None
        self._request = safety.REQUEST_NONE  # to stop: of the terminal, people, or the logger's end
        self._aborted = 0.0  # when an abort was posted, s
        self._posted_live = NO_REQUEST.live
        self._parts = 0
        self._problem = ""
        self._end: LoopResult | None = None
        self._refused = ""
        self._died = ""
        self._compiled_from = -1
        self._log_abandoned = False  # the rest of the log is abandoned
        self._loop_progress = StallTimer()
        self._log_progress = StallTimer()
        self._whereabouts = FolderTracker(folder)

    @property
    def folder(self) -> Path:
        """The folder in which the record is now."""
        return self._whereabouts.folder

    def supervise(
        self, on_snapshot: Callable[[Snapshot], None], get_request: Callable[[], int]
    ) -> Outcome:
        """Run to the end and return the outcome.

        Ten times a second the supervisor passes a snapshot to ``on_snapshot`` and posts the request
        of people that ``get_request`` returns (`rig.realtime.safety.REQUEST_*`). Whatever goes
        wrong here, the loop is stopped, the logger saves the rows in the ring, and no process is
        left behind.
        """
        # Two threads: a terminal that blocks must not delay the progress file on the disk.
        with drawing_thread(on_snapshot) as draw, drawing_thread(self._write_progress) as save:

            def show(snapshot: Snapshot) -> None:
                draw(snapshot)
                save(snapshot)

            return self._run_to_end(show, get_request)

    def _run_to_end(
        self, show: Callable[[Snapshot], None], get_request: Callable[[], int]
    ) -> Outcome:
        loop: Child | None = None
        logger: Child | None = None
        try:
            self._io_processes.start()
            self._listen()
            if not self._mode.interpreted:
                errors = self.folder / "compiler.stderr"
                self._compiler = TickCompiler(self._task, self._mode, errors)
            logger = self._start_logger()  # first: all rows then outlive this process
            self._post()
            loop = self._start_loop()
            self._io_processes.release_lifeline()
            while loop.alive() or logger.alive() or self._logger_failed(logger):
                self._read_loop_reports(loop)
                if not loop.alive():
                    self._ring.mark_finished()
                self._take_terminal_request(get_request())
                self._post()
                self._kill_hung_loop(loop)
                died = self._io_processes.check()
                if loop.alive():  # I/O processes end by themselves after the loop
                    self._died = died or self._died
                self._problem = self._died or self._problem
                logger = self._supervise_logger(logger, loop)
                if self._log_abandoned and not loop.alive():
                    break
                show(self._snapshot())
                self._woken.wait(POLL_INTERVAL_S)
                self._woken.clear()
        except IoProcessError as error:
            self._refused = str(error)
        finally:
            self._shut_down(loop, logger)
        show(self._snapshot())
        return self._outcome(loop)

    def _set_request(self, request: int) -> None:
        """Put a request to stop in force, unless one of higher priority is in force already."""
        if _STOP_PRIORITY.get(request, 0) > _STOP_PRIORITY.get(self._request, 0):
            self._request = request
            if request == safety.REQUEST_ABORT:
                self._aborted = time.monotonic()

    def _take_terminal_request(self, request: int) -> None:
        before = self._request
        self._set_request(request)
        if self._request != before:
            self._orders.note_terminal(request)

    def _listen(self) -> None:
        """Open the socket for requests of people; without it the run goes on."""
        facts = {
            "run": self._run,
            "folder": str(self.folder),
            "rig": self._task.kind_name,
            "mode": self._mode.name,
            "dt": self._task.dt,
            "schema": schema(self._task.kind.row_type),
            "supervisor": os.getpid(),
            "segments": {
                key: list(getattr(self._task.params.segments, key))
                for key in ("row", "phase", "ticks")
            },
        }
        try:
            self._server = RequestServer(self.folder, self._orders, facts, self._ring_fd)
        except OSError as error:
            self._problem = f"no requests from pages and commands: {error.strerror or error}"

    def _post(self) -> None:
        """Post the requests in force; the post itself is the heartbeat."""
        request = self._orders.update(self._latest_row())
        self._set_request(request.code)
        set_point = self._orders.set_point()
        if set_point is not None and set_point[0] != self._posted_live:
            self._posted_live = set_point[0]
            # Before the request with its number.
            self._live.post(self._live_type(set_point[0], *set_point[1]))
        request = request._replace(code=self._request or request.code)
        self._mailbox.post(SupervisorMessage(time.monotonic(), *request))

    def _kill_hung_loop(self, loop: Child) -> None:
        """Kill a loop that ticks no more or does not carry out an abort.

        Its devices then miss its commands and go to their own safe state.
        """
        if not loop.alive() or self._end is not None:  # the ended loop waits for its rows
            return
        waits_for_logger = self._ring.head - self._ring.tail >= self._ring.capacity
        chooses = self._latest_row().get("plan.phase") == CHOICE and not self._mode.real_clock
        idle = self._ring.head == 0 or waits_for_logger or chooses
        stalled_s = 0.0 if idle else self._loop_progress.seconds_unchanged(self._ring.head)
        hung = stalled_s > HANG_TIMEOUT_S
        if hung or (self._aborted and time.monotonic() - self._aborted > ABORT_TIMEOUT_S):
            self._problem = "the loop hung" if hung else "the loop did not carry out an abort"
            loop.process.kill()

    def _supervise_logger(self, logger: Child, loop: Child) -> Child:
        """Read the logger's reports; restart a dead or hanging logger, give up after too many."""
        self._read_logger_reports(logger)
        unsaved = self._ring.head - self._ring.tail
        ending_late = not loop.alive() and logger.alive()
        if unsaved == 0 and not ending_late:
            self._log_progress = StallTimer()
        else:
            stalled_s = self._log_progress.seconds_unchanged(self._ring.tail)
            if stalled_s > STALL_TIMEOUT_S and logger.alive():
                self._problem = "the logger hangs"
                logger.end(0.0)
        if logger.alive() or not self._logger_failed(logger):
            return logger
        self._log_progress = StallTimer()
        if not refers_to(self.folder, self._whereabouts.descriptor):
            # Before `can_locate_record`, which may copy the whole record.
            self._set_request(safety.REQUEST_LOGGER_LOST)
        failed = (
            self._parts > MAX_LOGGER_RESTARTS
            or logger.process.returncode == log_process.EXIT_ROWS_LOST
        )
        if failed or not self._whereabouts.can_locate_record():
            self._log_abandoned = True
            self._problem = f"the log is lost: {self._problem or logger.last_message()}"
            self._ring.abandon()
        if self._log_abandoned or self._whereabouts.problem:
            self._set_request(safety.REQUEST_LOGGER_LOST)
        return logger if self._log_abandoned else self._start_logger()

    def _read_logger_reports(self, logger: Child) -> None:
        self._whereabouts.open_part(f"{MCAP}.part{self._parts - 1}")
        for report in logger.read_reports():
            match report:
                case DiskState(problem) | RecordLost(problem):
                    self._problem = problem
                case RecordMoved(folder, why):
                    self._whereabouts.relocate(Path(folder), why)
                    self._journal.follow_record()
                    self._problem = self._whereabouts.problem
            if self._problem:
                self._set_request(safety.REQUEST_LOGGER_LOST)

    def _shut_down(self, loop: Child | None, logger: Child | None) -> None:
        """End every process and close every descriptor; in a good run all have ended already."""
        if self._compiler is not None:
            self._compiler.end()
        if loop is not None:
            if loop.alive():
                loop.process.terminate()  # the loop treats it as an abort
            loop.end(ABORT_TIMEOUT_S)
            self._read_loop_reports(loop)
        self._io_processes.end(ABORT_TIMEOUT_S)  # after the loop, which needs them until its end
        self._ring.mark_finished()
        if logger is not None:
            logger.end(STALL_TIMEOUT_S)
            self._read_logger_reports(logger)
            try:
                folder = self._whereabouts.locate_record()
                if self._parts == 1 and logger.process.returncode == 0:
                    (folder / f"{MCAP}.part0").rename(folder / MCAP)
            except OSError as error:  # only the open file remains
                self._problem = f"the record could not be kept: {error}"
        if self._server is not None:
            self._server.close()
        self._whereabouts.close()
        for descriptor in (self._ring_fd, self._mailbox_fd, self._live_fd):
            os.close(descriptor)

    def _start_logger(self) -> Child:
        job = handover.dumps(self._logger_job())
        self._parts += 1
        fds = (self._ring_fd, self._folder_lock)
        return Child("rig.processes.logger", job, fds, self.folder / "logger.stderr")

    def _logger_job(self) -> LoggerJob:
        return LoggerJob(
            ring=self._ring_fd,
            rows=schema(self._task.kind.row_type),
            supervisor=os.getpid(),
            folder=str(self.folder),
            folder_lock=self._folder_lock,
            part=f"{MCAP}.part{self._parts}",
            attachments=self._attachments,
            run=self._run,
            mode=self._mode.name,
            clock="real" if self._mode.real_clock else "virtual",
            rate_hz=1.0 / self._task.dt,
            disk_timeout_s=DISK_TIMEOUT_S,
        )

    def _start_loop(self) -> Child:
        task, mode = self._task, self._mode
        job = LoopJob(
            real_clock=mode.real_clock,
            realtime_required=task.realtime_required and mode.real_clock,
            dt=task.dt,
            ring=self._ring_fd,
            mailbox=self._mailbox_fd,
            supervisor=os.getpid(),
            params=task.params,
            devices=self._device_config(),
            supervisor_timeout=task.supervisor_timeout,
            law=task.law,
            logger=(self._logger_job(),),
            code=self._compiler.folder if self._compiler else "",
            coupled=mode.coupled and not mode.interpreted,
            compiles=self._compiler.compiles if self._compiler else False,
            live=self._live_fd,
        )
        slots = (slot.fd for slot in self._io_processes.slots.values())
        locks = (self._folder_lock, *self._wire_locks)
        fds = (
            self._ring_fd,
            self._mailbox_fd,
            self._live_fd,
            *slots,
            self._io_processes.loop_end,
            *locks,
        )
        errors = self.folder / "loop.stderr"
        return Child(LOOP_MODULE, handover.dumps(job), fds, errors, task.tick, mode.device_module)

    def _device_config(self) -> dict[str, Any]:
        """Return the devices' configuration for the loop; I/O processes add facts and mailboxes."""
        if not self._mode.io_processes:
            return self._mode.devices
        shared = {"facts": self._io_processes.facts, "mailboxes": self._io_processes.slots}
        return self._mode.devices | shared

    def _read_loop_reports(self, loop: Child) -> None:
        for report in loop.read_reports():
            match report:
                case LoopPrivileges(found):
                    granted = found[0]._asdict() if found else None
                    with suppress(OSError):
                        write_json(self.folder, log_process.PRIVILEGES, granted)
                case CodeMissing():
                    if self._compiler is not None:
                        self._compiler.start()
                case Compiled(tick):
                    self._compiled_from = tick
                case Refused(why):
                    self._refused = why
                case LoopResult():
                    self._end = report
                case WireReport(values):
                    with suppress(OSError):
                        write_json(self.folder, WIRES_FILE, values)

    def _logger_failed(self, logger: Child) -> bool:
        """Return whether the logger has ended without finishing its file."""
        return logger.process.returncode not in (None, 0) and not self._log_abandoned

    def _write_progress(self, snapshot: Snapshot) -> None:
        """Write the progress to disk, for a recovery after all processes were killed."""
        if row := snapshot.row:
            progress = {"last_tick": int(row["tick"]), "skipped": int(row["timing.skipped"])}
            write_progress(self._whereabouts.descriptor, **progress)

    def _snapshot(self) -> Snapshot:
        unsaved = self._ring.head - self._ring.tail
        row = self._latest_row()
        reason = self._reasons.name(int(row.get("safety.reason", NO_REASON)))
        people = self._orders.describe()
        compiling = self._compiler is not None and self._compiler.running
        return Snapshot(row, self._ring.dropped, unsaved, self._problem, reason, people, compiling)

    def _latest_row(self) -> dict[str, float | int]:
        packed = self._ring.latest()
        if packed is None:
            return {}
        return dict(zip(self._names, self._layout.unpack(packed), strict=True))

    def _trip_messages(self) -> tuple[str, ...]:
        """Return the signal of a trip by NaN or infinity."""
        if self._end is None or self._end.reason != Reason.NOT_FINITE:
            return ()
        newest = self._ring.remaining_rows()[-ROWS * self._ring.row_size :]
        unpacked = self._layout.iter_unpack(newest)
        rows = [dict(zip(self._names, row, strict=True)) for row in unpacked]
        return tuple(filter(None, (first_not_finite(rows, self._units),)))

    def _outcome(self, loop: Child | None) -> Outcome:
        end, row = self._end, self._latest_row()
        if end is not None:
            status, cause = end_status(end.reason), self._reasons.name(end.reason)
        elif self._refused:
            status, cause = "refused", self._refused
        else:
            status, cause = (
                "crashed",
                self._problem or (f"loop: {loop.last_message()}" if loop else ""),
            )
        return Outcome(
            status=status,
            reason=cause,
            ticks=end.ticks if end else self._ring.head + self._ring.dropped,
            skipped=end.skipped if end else int(row.get("timing.skipped", 0)),
            dropped=self._ring.dropped,
            unsaved=self._ring.head - self._ring.tail,
            logger_restarts=max(0, self._parts - 1),
            last_row=row,
            died=self._died,
            messages=(*self._io_processes.messages, *self._trip_messages(), *_code_messages(end)),
            moved=self._whereabouts.problem,
            compiled_from=self._compiled_from,
        )


def _ring_capacity(dt: float) -> int:
    """Return the rows of a ring for ticks of ``dt`` (s): 65 s, in which a logger is replaced."""
    return max(ring.CAPACITY, round(1e-3 * ring.CAPACITY / dt))


def _code_messages(end: LoopResult | None) -> tuple[str, ...]:
    if end is None or not end.code_problem:
        return ()
    return (f"the tick ran interpreted, its code cannot be used: {end.code_problem}",)


_STOP_PRIORITY = {
    safety.REQUEST_ABORT: 3,
    safety.REQUEST_LOGGER_LOST: 2,
    safety.REQUEST_STOP: 1,
    safety.REQUEST_NO_OPERATOR: 1,
}
