"""The supervisor: starts logger and loop, watches both, and sees a run to its end.

It never touches a device. What it asks of the loop goes through the mailbox; what it shows comes
from the newest row in the ring. The logger is there before the loop and outlives it, and both
outlive the supervisor: if it dies, or shows no sign of life for too long, the loop stops by itself
and the logger saves what is left.

The thread that gives the signs of life waits neither for a terminal nor for a disk: both can stand
still for longer than the loop does without them. A thread of its own draws
(`rig.processes.display`).
"""

import json
import os
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from rig.processes import handover, mailbox
from rig.processes.child import Child, Progress
from rig.processes.display import Display
from rig.processes.io_processes import IoProcessError, IoProcesses
from rig.processes.loop_process import Job
from rig.processes.mailbox import Mailbox, Request
from rig.processes.run_types import Outcome, Setup, Snapshot
from rig.realtime import safety
from rig.realtime.safety import Reason
from rig.recording import logger as log_process
from rig.recording import ring
from rig.recording.folder_watch import FolderTracker, refers_to, write_progress
from rig.recording.row_layout import layout, leaves
from rig.recording.runs.create import end_status, write_json
from rig.recording.runs.folder import MCAP

POLL = 0.1  # s between looks
RESTARTS = 5  # of a killed logger in one run
DISK_TIMEOUT_S = 20.0  # s a failing disk is retried before the rest of the log is given up
STALL = 60.0  # s without a row saved, or without an end, after which the logger is restarted
HANG = 10.0  # s without a tick after which the loop is killed
DEAF = 5.0  # s the loop may take to heed an abort


class Run:
    """One run under supervision; call `supervise` once."""

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._ring_fd = ring.create(setup.kind.row_type)
        self._mail_fd = mailbox.create()
        self._ring = ring.RingReader(self._ring_fd)
        self._mail = Mailbox(self._mail_fd, Request)
        self._layout = layout(setup.kind.row_type)
        self._names = [leaf.name for leaf in leaves(setup.kind.row_type)]
        self._companions = IoProcesses(setup.io_processes, setup.folder, setup.wire_locks)
        self._request = safety.REQUEST_NONE
        self._aborted = 0.0  # when an abort was posted, s
        self._parts = 0
        self._trouble = ""
        self._end: dict[str, Any] | None = None
        self._refused = ""
        self._died = ""
        self._lost = False  # the log is given up
        self._loop_moves = Progress()
        self._log_moves = Progress()
        self._place = FolderTracker(setup.folder)

    @property
    def folder(self) -> Path:
        """Where the record is."""
        return self._place.folder

    def supervise(self, watch: Callable[[Snapshot], None], asked: Callable[[], int]) -> Outcome:
        """Run to the end.

        Ten times a second ``watch`` is shown the run and ``asked`` gives what people request
        (`rig.realtime.safety.REQUEST_*`). Whatever goes wrong here, the loop is stopped, the logger
        saves what there is, and no process is left behind.
        """
        # Each waits for its own: a terminal that stands still must not keep the note from the disk.
        with Display(watch) as display, Display(self._note) as note:

            def show(snapshot: Snapshot) -> None:
                display.show(snapshot)
                note.show(snapshot)

            return self._supervised(show, asked)

    def _supervised(self, show: Callable[[Snapshot], None], asked: Callable[[], int]) -> Outcome:
        loop: Child | None = None
        logger: Child | None = None
        try:
            self._companions.start()
            logger = self._start_logger()  # first: from the first tick on, rows outlive us
            self._post()
            loop = self._start_loop()
            self._companions.leave_to_the_loop()
            while loop.alive() or logger.alive() or self._unfinished(logger):
                self._listen(loop)
                if not loop.alive():
                    self._ring.mark_finished()
                self._ask(asked())
                self._look_after(loop)
                died = self._companions.listen()
                if loop.alive():  # when it has ended, they end as well
                    self._died = died or self._died
                self._trouble = self._died or self._trouble
                logger = self._look_after_log(logger, loop)
                if self._lost and not loop.alive():
                    break
                show(self._snapshot())
                time.sleep(POLL)
        except IoProcessError as error:
            self._refused = str(error)
        finally:
            self._lay_to_rest(loop, logger)
        show(self._snapshot())
        return self._outcome(loop)

    def _ask(self, request: int) -> None:
        """Post what is requested; a stop is never taken back by a lesser one."""
        if _RANK.get(request, 0) >= _RANK.get(self._request, 0) and request != self._request:
            self._request = request
            if request == safety.REQUEST_ABORT:
                self._aborted = time.monotonic()
        self._post()

    def _post(self) -> None:
        """Post the request in force; the post itself is the sign of life."""
        self._mail.post(Request(self._request, time.monotonic()))

    def _look_after(self, loop: Child) -> None:
        """A loop that ticks no more, or does not heed an abort, is killed.

        Its devices then miss its commands and go to their own safe state.
        """
        if not loop.alive() or self._end is not None:  # done: it sees the log to its end
            return
        waits = self._ring.head - self._ring.tail >= self._ring.capacity
        still = self._loop_moves.still(self._ring.head) if self._ring.head and not waits else 0.0
        deaf = self._aborted and time.monotonic() - self._aborted > DEAF
        if still > HANG or deaf:
            self._trouble = "the loop hung" if still > HANG else "the loop did not heed an abort"
            loop.process.kill()

    def _look_after_log(self, logger: Child, loop: Child) -> Child:
        """Hear the logger; restart it when it was killed or hangs, give it up when that is vain."""
        self._listen_to_log(logger)
        behind = self._ring.head - self._ring.tail
        ending_late = not loop.alive() and logger.alive()
        if behind == 0 and not ending_late:
            self._log_moves = Progress()
        elif self._log_moves.still(self._ring.tail) > STALL and logger.alive():
            self._trouble = "the logger hangs"
            logger.end(0.0)
        if logger.alive() or not self._unfinished(logger):
            return logger
        self._log_moves = Progress()
        if not refers_to(self.folder, self._place.descriptor):
            self._ask(safety.REQUEST_LOGGER_LOST)  # first: to settle it may copy the whole record
        vain = self._parts > RESTARTS or logger.process.returncode == log_process.EXIT_ROWS_LOST
        if vain or not self._place.can_locate_record():
            self._lost = True
            self._trouble = f"the log is lost: {self._trouble or logger.last_message()}"
            self._ring.abandon()
        if self._lost or self._place.problem:
            self._ask(safety.REQUEST_LOGGER_LOST)
        return logger if self._lost else self._start_logger()

    def _listen_to_log(self, logger: Child) -> None:
        self._place.open_part(f"{MCAP}.part{self._parts - 1}")
        for event in logger.heard():
            self._trouble = event.get("error") or event.get("why") or ""
            if event["event"] == "place":
                self._place.relocate(Path(event["folder"]), event["why"])
                self._trouble = self._place.problem
            if self._trouble:
                self._ask(safety.REQUEST_LOGGER_LOST)

    def _lay_to_rest(self, loop: Child | None, logger: Child | None) -> None:
        """No process, no file descriptor is left; in a run that went well all has ended already."""
        if loop is not None:
            if loop.alive():
                loop.process.terminate()  # the loop takes it as an abort
            loop.end(DEAF)
            self._listen(loop)
        self._companions.end(DEAF)  # after the loop: what they hold for it is then let go
        self._ring.mark_finished()
        if logger is not None:
            logger.end(STALL)
            self._listen_to_log(logger)
            try:
                folder = self._place.locate_record()
                if self._parts == 1 and logger.process.returncode == 0:
                    (folder / f"{MCAP}.part0").rename(folder / MCAP)
            except OSError as error:  # what is open is all that is left: say so, and end
                self._trouble = f"the record could not be kept: {error}"
        self._place.close()
        os.close(self._ring_fd)
        os.close(self._mail_fd)

    def _start_logger(self) -> Child:
        job = self._log_job()
        self._parts += 1
        fds = (self._ring_fd, *_held(self._setup.folder_lock))
        errors = self.folder / "logger.stderr"
        return Child("rig.recording.logger", handover.dumps(job), fds, errors)

    def _log_job(self) -> log_process.LoggerJob:
        setup = self._setup
        return log_process.LoggerJob(
            kind=setup.kind_name,
            ring=self._ring_fd,
            supervisor=os.getpid(),
            folder=str(self.folder),
            part=f"{MCAP}.part{self._parts}",
            attachments=setup.attachments,
            run=setup.folder.name,
            mode=setup.mode,
            clock="real" if setup.real_clock else "virtual",
            rate_hz=1.0 / setup.dt,
            disk_timeout_s=DISK_TIMEOUT_S,
        )

    def _start_loop(self) -> Child:
        setup = self._setup
        log = {"job": self._log_job()._asdict(), "ring": self._ring_fd}
        job = Job(
            real_clock=int(setup.real_clock),
            realtime_required=int(setup.realtime_required),
            dt=setup.dt,
            ring=self._ring_fd,
            mailbox=self._mail_fd,
            supervisor=os.getpid(),
            params=setup.params,
            devices=json.dumps(self._devices()),
            supervisor_timeout=setup.supervisor_timeout,
            last_logger=json.dumps(log | {"folder": setup.folder_lock}),
        )
        held = (*_held(setup.folder_lock), *setup.wire_locks)
        slots = self._companions.slots.values()
        fds = (self._ring_fd, self._mail_fd, *slots, self._companions.loop_end, *held)
        return Child(setup.loop_module, handover.dumps(job), fds, setup.folder / "loop.stderr")

    def _devices(self) -> dict[str, Any]:
        """What the loop is told of its devices, with what its companions found out."""
        if not self._setup.io_processes:
            return self._setup.devices
        known = {"facts": self._companions.facts, "mailboxes": self._companions.slots}
        return self._setup.devices | known

    def _listen(self, loop: Child) -> None:
        for event in loop.heard():
            if "privileges" in event:
                with suppress(OSError):
                    write_json(self.folder, log_process.PRIVILEGES, event["privileges"])
            if event["event"] == "refused" and "why" in event:
                self._refused = event["why"]
            elif event["event"] == "refused":
                denied = [f"{name} ({why})" for name, why in event["privileges"].items() if why]
                self._refused = f"the host did not grant {', '.join(denied)}"
            if event["event"] == "end":
                self._end = event

    def _unfinished(self, logger: Child) -> bool:
        """The logger has ended without having brought its file to an end."""
        return logger.process.returncode not in (None, 0) and not self._lost

    def _note(self, snapshot: Snapshot) -> None:
        """Note the progress on disk, for a recovery after all processes were killed."""
        if row := snapshot.row:
            seen = {"last_tick": int(row["tick"]), "skipped": int(row["timing.skipped"])}
            write_progress(self._place.descriptor, **seen)

    def _snapshot(self) -> Snapshot:
        behind = self._ring.head - self._ring.tail
        return Snapshot(self._latest(), self._ring.dropped, behind, self._trouble)

    def _latest(self) -> dict[str, float | int]:
        packed = self._ring.latest()
        if packed is None:
            return {}
        return dict(zip(self._names, self._layout.unpack(packed), strict=True))

    def _outcome(self, loop: Child | None) -> Outcome:
        end, row = self._end, self._latest()
        if end is not None:
            reason = Reason(end["reason"])
            status, why = end_status(reason), reason.name
        elif self._refused:
            status, why = "refused", self._refused
        else:
            status, why = (
                "crashed",
                self._trouble or (f"loop: {loop.last_message()}" if loop else ""),
            )
        put = self._ring.head + self._ring.dropped
        ended = end or {"ticks": put, "skipped": int(row.get("timing.skipped", 0))}
        return Outcome(
            status,
            why,
            ended["ticks"],
            ended["skipped"],
            self._ring.dropped,
            self._ring.head - self._ring.tail,
            max(0, self._parts - 1),
            row,
            self._died,
            tuple(self._companions.said),
            self._place.problem,
        )


_RANK = {safety.REQUEST_ABORT: 3, safety.REQUEST_LOGGER_LOST: 2, safety.REQUEST_STOP: 1}


def _held(*locks: int) -> tuple[int, ...]:
    return tuple(fd for fd in locks if fd >= 0)
