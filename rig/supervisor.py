"""The supervisor: starts logger and loop, watches both, and sees a run to its end.

It never touches a device. What it asks of the loop goes through the mailbox; what it shows comes
from the newest row in the ring. The logger is there before the loop and outlives it, and both
outlive the supervisor: if it dies, the loop stops by itself and the logger saves what is left.
"""

import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from rig import cycle, handover, mailbox, ring, safety
from rig import logger as log_process
from rig.child import Child, Progress
from rig.companions import Companion, CompanionError, Companions
from rig.loop_process import Job
from rig.mailbox import Mailbox, Request
from rig.record import layout, leaves
from rig.runs.create import ending, note_progress, write_json
from rig.runs.folder import MCAP
from rig.safety import Reason

POLL = 0.1  # s between looks
RESTARTS = 5  # of a killed logger in one run
DISK_PATIENCE = 20.0  # s a failing disk is retried before the rest of the log is given up
STALL = 60.0  # s without a row saved, or without an end, after which the logger is restarted
HANG = 10.0  # s without a tick after which the loop is killed
DEAF = 5.0  # s the loop may take to heed an abort


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
    rung: str
    folder_lock: int = -1  # file descriptor, held as long as anything of the run lives; -1: none
    realtime_lock: int = -1  # file descriptor, held as long as the loop lives; -1: none
    companions: tuple[Companion, ...] = ()  # processes that serve the loop from beside it


class Snapshot(NamedTuple):
    """The run as it stands, for whoever draws it."""

    row: dict[str, float | int]  # newest row by dotted field name; empty before the first
    dropped: int
    behind: int  # rows in the ring that are not safe on disk yet
    trouble: str  # what is wrong with the log, empty if nothing


class Outcome(NamedTuple):
    """How the run ended."""

    status: str  # complete, stopped, fault, crashed, refused
    reason: str  # name of rig.safety.Reason, or what the process left as last words
    ticks: int
    skipped: int
    dropped: int  # rows the loop could not hand over
    unsaved: int  # rows handed over and not saved
    logger_restarts: int
    last_row: dict[str, float | int]
    died: str = ""  # which process beside the loop died, and its last words; empty: none
    said: tuple[str, ...] = ()  # what those processes had to tell


class Run:
    """One run under supervision; call `supervise` once."""

    def __init__(self, setup: Setup) -> None:
        self._setup = setup
        self._ring_fd = ring.create(setup.kind.row_type)
        self._mail_fd = mailbox.create()
        self._ring = ring.Reader(self._ring_fd)
        self._mail = Mailbox(self._mail_fd, Request)
        self._layout = layout(setup.kind.row_type)
        self._names = [leaf.name for leaf in leaves(setup.kind.row_type)]
        self._companions = Companions(setup.companions, setup.folder)
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

    def supervise(self, watch: Callable[[Snapshot], None], asked: Callable[[], int]) -> Outcome:
        """Run to the end.

        Ten times a second ``watch`` is shown the run and ``asked`` gives what people request
        (`rig.safety.REQUEST_*`). Whatever goes wrong here, the loop is stopped, the logger saves
        what there is, and no process is left behind.
        """
        loop: Child | None = None
        logger: Child | None = None
        try:
            self._companions.start()
            logger = self._start_logger()  # first: from the first tick on, rows outlive us
            loop = self._start_loop()
            while loop.alive() or logger.alive() or self._unfinished(logger):
                self._listen(loop)
                if not loop.alive():
                    self._ring.bury()
                self._ask(asked())
                self._look_after(loop)
                self._died = self._companions.listen() or self._died
                self._trouble = self._died or self._trouble
                logger = self._look_after_log(logger, loop)
                if self._lost and not loop.alive():
                    break
                self._show(watch)
                time.sleep(POLL)
        except CompanionError as error:
            self._refused = str(error)
        finally:
            self._lay_to_rest(loop, logger)
        self._show(watch)
        return self._outcome(loop)

    def _ask(self, request: int) -> None:
        """Post a request; a stop is never taken back by a lesser one."""
        if _RANK.get(request, 0) < _RANK.get(self._request, 0) or request == self._request:
            return
        self._request = request
        if request == safety.REQUEST_ABORT:
            self._aborted = time.monotonic()
        self._mail.post(Request(request))

    def _look_after(self, loop: Child) -> None:
        """A loop that ticks no more, or does not heed an abort, is killed.

        Its devices then miss its commands and go to their own safe state.
        """
        if not loop.alive():
            return
        waits = self._ring.head - self._ring.tail >= self._ring.capacity
        still = self._loop_moves.still(self._ring.head) if self._ring.head and not waits else 0.0
        deaf = self._aborted and time.monotonic() - self._aborted > DEAF
        if still > HANG or deaf:
            self._trouble = "the loop hung" if still > HANG else "the loop did not heed an abort"
            loop.process.kill()

    def _look_after_log(self, logger: Child, loop: Child) -> Child:
        """Hear the logger; restart it when it was killed or hangs, give it up when that is vain."""
        for event in logger.heard():
            self._trouble = event.get("error", "")
            if self._trouble:
                self._ask(safety.REQUEST_LOGGER_LOST)
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
        if self._parts > RESTARTS or logger.process.returncode == log_process.DISK:
            self._lost = True
            self._trouble = f"the log is lost: {self._trouble or logger.last_words()}"
            self._ring.abandon()
            self._ask(safety.REQUEST_LOGGER_LOST)
            return logger
        return self._start_logger()

    def _lay_to_rest(self, loop: Child | None, logger: Child | None) -> None:
        """No process, no file descriptor is left; in a run that went well all has ended already."""
        if loop is not None:
            if loop.alive():
                loop.process.terminate()  # the loop takes it as an abort
            loop.end(DEAF)
            self._listen(loop)
        self._companions.end(DEAF)  # after the loop: what they hold for it is then let go
        self._ring.bury()
        if logger is not None:
            logger.end(STALL)
            if self._parts == 1 and logger.process.returncode == 0:
                (self._setup.folder / f"{MCAP}.part0").rename(self._setup.folder / MCAP)
        os.close(self._ring_fd)
        os.close(self._mail_fd)

    def _start_logger(self) -> Child:
        setup = self._setup
        part = f"{MCAP}.part{self._parts}"
        self._parts += 1
        job = log_process.Job(
            kind=setup.kind_name,
            ring=self._ring_fd,
            supervisor=os.getpid(),
            folder=str(setup.folder),
            part=part,
            attachments=setup.attachments,
            run=setup.folder.name,
            rung=setup.rung,
            clock="real" if setup.real_clock else "virtual",
            rate_hz=1.0 / setup.dt,
            patience=DISK_PATIENCE,
        )
        errors = setup.folder / "logger.stderr"
        fds = (self._ring_fd, *_held(setup.folder_lock))
        return Child("rig.logger", handover.dumps(job), fds, errors)

    def _start_loop(self) -> Child:
        setup = self._setup
        job = Job(
            real_clock=int(setup.real_clock),
            realtime_required=int(setup.realtime_required),
            dt=setup.dt,
            ring=self._ring_fd,
            mailbox=self._mail_fd,
            supervisor=os.getpid(),
            params=setup.params,
            devices=json.dumps(self._devices()),
        )
        held = _held(setup.folder_lock, setup.realtime_lock)
        fds = (self._ring_fd, self._mail_fd, *self._companions.slots.values(), *held)
        return Child(setup.loop_module, handover.dumps(job), fds, setup.folder / "loop.stderr")

    def _devices(self) -> dict[str, Any]:
        """What the loop is told of its devices, with what its companions found out."""
        if not self._setup.companions:
            return self._setup.devices
        known = {"facts": self._companions.facts, "mailboxes": self._companions.slots}
        return self._setup.devices | known

    def _listen(self, loop: Child) -> None:
        for event in loop.heard():
            if "privileges" in event:
                write_json(self._setup.folder, log_process.PRIVILEGES, event["privileges"])
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

    def _show(self, watch: Callable[[Snapshot], None]) -> None:
        row = self._latest()
        if row:
            note_progress(self._setup.folder, int(row["tick"]), int(row["timing.skipped"]))
        behind = self._ring.head - self._ring.tail
        watch(Snapshot(row, self._ring.dropped, behind, self._trouble))

    def _latest(self) -> dict[str, float | int]:
        packed = self._ring.latest()
        if packed is None:
            return {}
        return dict(zip(self._names, self._layout.unpack(packed), strict=True))

    def _outcome(self, loop: Child | None) -> Outcome:
        end, row = self._end, self._latest()
        if end is not None:
            reason = Reason(end["reason"])
            status, why = ending(reason), reason.name
        elif self._refused:
            status, why = "refused", self._refused
        else:
            status, why = "crashed", self._trouble or (f"loop: {loop.last_words()}" if loop else "")
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
        )


_RANK = {safety.REQUEST_ABORT: 3, safety.REQUEST_LOGGER_LOST: 2, safety.REQUEST_STOP: 1}


def _held(*locks: int) -> tuple[int, ...]:
    return tuple(fd for fd in locks if fd >= 0)
