"""The logger process: drains the ring, writes MCAP, flushes twice a second, certifies the timing.

Rows count as safe only when they are flushed; only then does the ring's tail move. So a killed
logger loses nothing: the next one goes on from the tail in a new part of the file. Trouble with
the disk is said on standard output and retried; it never reaches the loop. At every flush it is
looked whether the file is still where it belongs; if not, it is written on where its folder went,
or, when it was deleted, in a rescue folder (`rig.recording.folder_watch`).
"""

import errno
import fcntl
import json
import os
import signal
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from numpy.lib.recfunctions import repack_fields

from rig.kinds import KINDS
from rig.processes import handover
from rig.realtime.safety import Reason
from rig.recording.folder_watch import folder_now, held_folder, leads_to, rescued
from rig.recording.mcap_writer import RowWriter
from rig.recording.ring import Producer, Reader, consume
from rig.recording.runs import RunError, mcap_file
from rig.recording.runs.create import ending
from rig.recording.runs.folder import STATUS, parts
from rig.recording.timing import Certificate

FLUSH = 0.5  # s between flushes
RETRY = 0.5  # s between attempts on a full disk
ORPHANED = 5.0  # s without a row, and without a supervisor, that end the log
IDLE = 0.02  # s without a row before the next look; longer blocks cost less a row
_HOPELESS = {errno.EROFS, errno.EIO, errno.ESTALE, errno.EACCES, errno.EPERM, errno.ENODEV}
DISK = 74  # exit code: rows were lost to the disk


class Job(NamedTuple):
    """What the supervisor asks of the logger."""

    kind: str
    ring: int  # file descriptor
    supervisor: int  # process id
    folder: str  # the run's
    part: str  # file to write, new
    attachments: tuple[str, ...]  # files of the folder to put into it
    run: str  # run id
    mode: str
    clock: str  # "virtual" or "real"
    rate_hz: float
    disk_timeout_s: float  # s of a failing disk after which the rest is lost


PRIVILEGES = "privileges.json"  # left in the folder by the supervisor when the loop reports


class Log:
    """One part of the run's record, being written."""

    def __init__(self, job: Job) -> None:
        kind = KINDS[job.kind]
        self._job = job
        self._folder = Path(job.folder)
        self._folder_fd = held_folder(self._folder)
        self._lock = consume(job.ring)  # before the tail is read: another may still move it
        self._reader = Reader(job.ring)
        self._certificate = Certificate(kind.row_type)
        self._flushed = self._moved = time.monotonic()
        self._failing_since: float | None = None
        self._left: set[Path] = set()  # folders that the record had to leave
        self._head = 0  # rows the ring had when it last moved
        self._count_earlier_parts(self._folder)
        self._texts: dict[str, bytes] = {}
        for name in (*job.attachments, STATUS):  # the last so that a rescued run is listed as it is
            with suppress(OSError):  # the rows count, also in a folder of which nothing is left
                self._texts[name] = (self._folder / name).read_bytes()
        attached = {name: text for name, text in self._texts.items() if name != STATUS}
        self._writer = RowWriter(
            self._folder / job.part,
            kind.row_type,
            attached,
            {"run": {"run": job.run, "mode": job.mode}},
            start_utc_ns=self._wait_start(),
        )

    def run(self) -> int:
        """Log until the rows end; returns the exit code."""
        quarter = self._reader.capacity // 4
        while not self._complete():
            block = b"" if self._failing_since else self._reader.take()
            if block:
                self._writer.append(block)
                self._certificate.add(block)
            waited = time.monotonic() - self._flushed
            if self._reader.uncommitted >= quarter or waited >= FLUSH:
                if not self._flush():
                    return DISK
            elif not block:
                time.sleep(IDLE)
        for name, value in (("timing.json", self._timing()), ("status.json", self._status())):
            self._writer.attach(name, json.dumps(value, indent=2).encode())
        while not self._finish():
            if self._given_up():
                return DISK
            time.sleep(RETRY)
        return 0

    def _wait_start(self) -> int:
        """UTC of run time zero, once there is a loop that knows it; of now if there never is one.

        The logger is there before the first tick, so that no moment is left in which the death of
        the supervisor would leave a loop without a logger.
        """
        ring = self._reader
        while not ring.start_utc_ns and ring.state != Producer.FINISHED and not self._orphaned():
            time.sleep(IDLE)
        return ring.start_utc_ns or time.time_ns()

    def _complete(self) -> bool:
        finished = self._reader.state == Producer.FINISHED or self._orphaned()
        return finished and self._reader.pending == 0 and not self._failing_since

    def _orphaned(self) -> bool:
        """Supervisor and loop are both gone: nobody is left to say that no more rows will come."""
        now = time.monotonic()
        if self._reader.head != self._head or os.getppid() == self._job.supervisor:
            self._head, self._moved = self._reader.head, now
        if now - self._moved > ORPHANED:
            self._reader.bury()
            return True
        return False

    def _count_earlier_parts(self, folder: Path) -> None:
        """The certificate is the whole run's, so what a killed logger wrote counts too."""
        for path in parts(folder):
            with suppress(RunError):  # a part whose logger died before it wrote anything
                for block in mcap_file.blocks(mcap_file.scan(path), []):
                    self._certificate.add(repack_fields(block).tobytes())

    def _status(self) -> dict[str, Any]:
        """How the run ended, as far as its rows say."""
        reason = Reason(self._certificate.reason)
        return {
            "run": self._job.run,
            "mode": self._job.mode,
            "status": ending(reason),
            "reason": reason.name,
            "ticks": self._reader.head + self._reader.dropped,
            "dropped_rows": self._reader.dropped,
        }

    def _timing(self) -> dict[str, Any]:
        privileges = self._folder / PRIVILEGES
        until = time.monotonic() + 2.0  # a loop that ends at once is ahead of its supervisor
        while not privileges.exists() and time.monotonic() < until:
            time.sleep(IDLE)
        granted = json.loads(privileges.read_text()) if privileges.exists() else None
        return self._certificate.result(
            self._job.clock, self._job.rate_hz, self._reader.dropped, granted
        )

    def _flush(self) -> bool:
        """Make the rows taken so far safe; False when the disk has failed for too long."""
        self._flushed = time.monotonic()
        try:
            self._stay_reachable()
            self._writer.flush()
        except OSError as error:
            self._failed(error)
            if self._rescued_from_disk(error):
                return True  # the next flush writes there
            if self._given_up():
                return False
            time.sleep(RETRY)
            return True
        self._reader.commit()
        self._recovered()
        return True

    def _finish(self) -> bool:
        try:
            self._stay_reachable()
            self._writer.finish()
        except OSError as error:
            self._failed(error)
            self._rescued_from_disk(error)
            return False
        self._reader.commit()
        self._recovered()
        return True

    def _stay_reachable(self) -> None:
        """Go on writing where the record can be found; raises OSError if there is no such place."""
        fd, part = self._writer.descriptor, self._job.part
        if leads_to(self._folder / part, fd):
            return
        moved = folder_now(self._folder_fd)
        if moved is not None and leads_to(moved / part, fd):
            self._folder = moved
            self._writer.path = moved / part
            _say(event="place", folder=str(moved), why="the run's folder was moved")
        else:
            gone = "the run's folder was deleted" if moved is None else f"{part} was taken away"
            self._rescue(gone)

    def _rescue(self, why: str) -> None:
        if self._folder not in self._left:
            self._left.add(self._folder)
            _say(event="lost", why=why)  # first of all the rig stops; copying may take its time
        part = self._job.part
        saved = rescued(self._folder, self._texts, {part: self._writer.descriptor}, self._left)
        self._writer.go_on_in(saved / part)
        os.close(self._folder_fd)
        self._folder, self._folder_fd = saved, held_folder(saved)
        with suppress(OSError):  # as the run's own folder is, against a recovery meanwhile
            fcntl.flock(self._folder_fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        _say(event="place", folder=str(saved), why=why)

    def _rescued_from_disk(self, error: OSError) -> bool:
        """Save the record from a disk that takes nothing any more; a full one gets its time."""
        if error.errno not in _HOPELESS and not self._given_up():
            return False
        with suppress(OSError):
            self._rescue(f"{self._folder} cannot be written ({error.strerror})")
            self._failing_since = time.monotonic()  # the new place has its own time
            return True
        return False

    def _failed(self, error: OSError) -> None:
        if self._failing_since is None:
            self._failing_since = time.monotonic()
            _say(event="disk", error=error.strerror or str(error))

    def _recovered(self) -> None:
        if self._failing_since is not None:
            self._failing_since = None
            _say(event="disk", error="")

    def _given_up(self) -> bool:
        since = self._failing_since
        return since is not None and time.monotonic() - since > self._job.disk_timeout_s


def main() -> None:
    """Run the job on standard input."""
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):  # it ends when the rows end
        signal.signal(number, signal.SIG_IGN)
    job: Job = handover.loads(Job, sys.stdin.read())
    sys.exit(Log(job).run())


def _say(**event: Any) -> None:
    with suppress(OSError):  # nobody may be left to hear it
        os.write(1, f"{json.dumps(event)}\n".encode())


if __name__ == "__main__":
    main()
