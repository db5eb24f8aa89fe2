"""The supervisor: starts logger and loop, watches both, and sees a run to its end.

It never touches a device. What it asks of the loop goes through the mailbox; what it shows comes
from the newest row in the ring. The logger outlives the loop, and both outlive the supervisor: if
it dies, the loop stops by itself and the logger saves what is left.
"""

import json
import os
import queue
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, NamedTuple

from rig import cycle, handover, mailbox, ring, safety
from rig import logger as log_process
from rig.loop_process import REFUSED, Job
from rig.mailbox import Mailbox, Request
from rig.record import layout, leaves
from rig.runs.create import ending, write_json
from rig.runs.folder import MCAP
from rig.safety import Reason

POLL = 0.1  # s between looks
RESTARTS = 5  # of a killed logger in one run
DISK_PATIENCE = 20.0  # s a failing disk is retried before the rest of the log is given up
DRAIN = 60.0  # s the logger may take after the loop has ended


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


class _Child:
    """A process that takes a job on standard input and answers in JSON lines."""

    def __init__(self, module: str, job: str, fds: tuple[int, ...], errors: Path) -> None:
        self.events: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
        self._errors = errors
        with errors.open("ab") as sink:
            self.process = subprocess.Popen(
                [sys.executable, "-m", module],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=sink,
                pass_fds=fds,
                text=True,
                process_group=0,  # a Ctrl-C on the terminal is the supervisor's alone
            )
        assert self.process.stdin is not None
        try:
            self.process.stdin.write(job)
            self.process.stdin.close()
        except BrokenPipeError:
            pass  # it died at once: its exit code and its last words tell why
        self._listener = threading.Thread(
            target=self._listen, args=(self.process.stdout,), daemon=True
        )
        self._listener.start()

    def _listen(self, lines: IO[str]) -> None:
        with lines:
            for line in lines:
                self.events.put(json.loads(line))

    def alive(self) -> bool:
        return self.process.poll() is None

    def heard(self) -> list[dict[str, Any]]:
        """Events since the last call; after the end, all of them."""
        if not self.alive():
            self._listener.join(timeout=5.0)
        found = []
        while not self.events.empty():
            found.append(self.events.get())
        return found

    def end(self) -> None:
        """Wait until the process and what it said are all taken in."""
        self.process.wait()
        self._listener.join()

    def last_words(self) -> str:
        """The last line the process wrote to its error file."""
        text = self._errors.read_text(errors="replace").strip() if self._errors.exists() else ""
        return text.splitlines()[-1] if text else f"exit code {self.process.returncode}"


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
        self._request = safety.REQUEST_NONE
        self._parts = 0
        self._trouble = ""
        self._end: dict[str, Any] | None = None
        self._refused = False
        self._gone = False  # the log is given up

    def ask(self, request: int) -> None:
        """Post a request (`rig.safety.REQUEST_*`); a stop is never taken back by a lesser one."""
        stops = {
            safety.REQUEST_ABORT: 3,
            safety.REQUEST_LOGGER_LOST: 2,
            safety.REQUEST_STOP: 1,
        }
        if stops.get(request, 0) < stops.get(self._request, 0):
            return
        self._request = request
        self._mail.post(Request(request, 0))

    def supervise(self, watch: Callable[[Snapshot], None]) -> Outcome:
        """Run to the end; ``watch`` is called ten times a second and may call `ask`."""
        setup = self._setup
        started_ns = time.time_ns()
        logger = self._start_logger(started_ns)
        loop = self._start_loop()
        buried = 0.0
        try:
            while loop.alive() or logger.alive() or self._unfinished(logger):
                self._listen(loop)
                if not loop.alive() and buried == 0.0:
                    self._ring.bury()
                    buried = time.monotonic()
                for event in logger.heard():
                    self._disk(event.get("error", ""))
                if not logger.alive() and self._unfinished(logger):
                    if self._parts > RESTARTS or logger.process.returncode == log_process.DISK:
                        self._lose_log(logger)
                        if not loop.alive():
                            break
                    else:
                        logger = self._start_logger(started_ns)
                if buried and time.monotonic() - buried > DRAIN and not self._trouble:
                    self._trouble = "the logger does not come to an end"
                    logger.process.kill()
                watch(self._snapshot())
                time.sleep(POLL)
        finally:
            if loop.alive():
                loop.process.terminate()
                loop.process.wait(timeout=10.0)
            self._ring.bury()
        self._listen(loop)
        watch(self._snapshot())
        loop.end()
        logger.end()
        outcome = self._outcome(loop)
        if self._parts == 1 and logger.process.returncode == 0:
            (setup.folder / f"{MCAP}.part0").rename(setup.folder / MCAP)
        os.close(self._ring_fd)
        os.close(self._mail_fd)
        return outcome

    def _start_logger(self, started_ns: int) -> _Child:
        setup = self._setup
        part = f"{MCAP}.part{self._parts}"
        self._parts += 1
        job = log_process.Job(
            setup.kind_name,
            self._ring_fd,
            str(setup.folder),
            part,
            setup.attachments,
            started_ns,
            setup.folder.name,
            setup.rung,
            "real" if setup.real_clock else "virtual",
            1.0 / setup.dt,
            DISK_PATIENCE,
        )
        errors = setup.folder / "logger.stderr"
        return _Child("rig.logger", handover.dumps(job), (self._ring_fd,), errors)

    def _start_loop(self) -> _Child:
        setup = self._setup
        job = Job(
            int(setup.real_clock),
            int(setup.realtime_required),
            setup.dt,
            self._ring_fd,
            self._mail_fd,
            os.getpid(),
            setup.params,
            json.dumps(setup.devices),
        )
        fds = (self._ring_fd, self._mail_fd)
        return _Child(setup.loop_module, handover.dumps(job), fds, setup.folder / "loop.stderr")

    def _listen(self, loop: _Child) -> None:
        for event in loop.heard():
            if event["event"] in ("start", "refused"):
                write_json(self._setup.folder, log_process.PRIVILEGES, event["privileges"])
                self._refused = event["event"] == "refused"
            elif event["event"] == "end":
                self._end = event

    def _unfinished(self, logger: _Child) -> bool:
        """The logger has ended without having brought its file to an end."""
        return logger.process.returncode not in (None, 0) and not self._gone

    def _lose_log(self, logger: _Child) -> None:
        self._gone = True
        self._trouble = f"the log is lost: {self._trouble or logger.last_words()}"
        self._ring.abandon()
        self.ask(safety.REQUEST_LOGGER_LOST)

    def _disk(self, error: str) -> None:
        """The logger's disk fails (a text) or works again (empty)."""
        self._trouble = error
        if error:
            self.ask(safety.REQUEST_LOGGER_LOST)

    def _snapshot(self) -> Snapshot:
        return Snapshot(
            self._latest(), self._ring.dropped, self._ring.head - self._ring.tail, self._trouble
        )

    def _latest(self) -> dict[str, float | int]:
        packed = self._ring.latest()
        if packed is None:
            return {}
        return dict(zip(self._names, self._layout.unpack(packed), strict=True))

    def _outcome(self, loop: _Child) -> Outcome:
        end, row = self._end, self._latest()
        if end is not None:
            reason = Reason(end["reason"])
            status = ending(reason)
            why = reason.name
        elif self._refused or loop.process.returncode == REFUSED:
            status, why = "refused", "the host did not grant what the rig file requires"
        else:
            status, why = "crashed", loop.last_words()
        ended = end or {"ticks": self._ring.head, "skipped": int(row.get("timing.skipped", 0))}
        return Outcome(
            status,
            why,
            ended["ticks"],
            ended["skipped"],
            self._ring.dropped,
            self._ring.head - self._ring.tail,
            self._parts - 1,
            row,
        )
