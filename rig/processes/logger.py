"""The logger process: drains the ring, writes MCAP, flushes twice a second, certifies the timing.

Rows count as safe only after a flush; only then does the ring's tail move. So a killed logger loses
nothing: the next one continues from the tail in a new part of the file. The logger reports disk
errors on standard output and retries; they never reach the loop. At every flush it checks whether
the file is still in its place; if not, it continues where the folder was moved to, or, after a
deletion, in a rescue folder (`rig.recording.folder_watch`).
"""

import ctypes
import errno
import fcntl
import json
import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.lib.recfunctions import repack_fields

from rig.processes import handover
from rig.processes.messages import DiskState, LoggerJob, RecordLost, RecordMoved, report
from rig.recording.folder_watch import current_folder, open_folder, refers_to, save_to_rescue_folder
from rig.recording.journal import JOURNAL
from rig.recording.mcap_writer import RowWriter
from rig.recording.ring import ProducerState, RingReader, lock_consumer
from rig.recording.row_layout import Leaf
from rig.recording.runs import RunError, mcap_file
from rig.recording.runs.create import end_status
from rig.recording.runs.folder import (
    SOCKET,
    STATUS,
    mcap_parts,
    parse_json,
    recorded_reasons,
)

_BINS = 100_000  # 1 us each; values above 0.1 s count in the last bin
_PERCENTILES = {"p50": 0.50, "p99": 0.99, "p999": 0.999}


class TimingCertificate:
    """Accumulates the timing fields of packed rows: lateness of wake-ups, duration of ticks.

    Histograms of one microsecond: an eight-hour run costs no memory, and every percentile is exact
    to the bin.
    """

    def __init__(self, leaves: tuple[Leaf, ...]) -> None:
        names = [leaf.name for leaf in leaves]
        self._width = len(names)
        self._lateness = names.index("timing.lateness")
        self._work = names.index("timing.work")
        self._skipped = names.index("timing.skipped")
        self._reason = names.index("safety.reason")
        self._late = np.zeros(_BINS, dtype=np.int64)
        self._busy = np.zeros(_BINS, dtype=np.int64)
        self._latest = 0.0
        self._last_tick = -1
        self.ticks = 0
        self.skipped = 0
        self.reason = 0  # `rig.realtime.reasons` of the last row

    def add(self, block: bytes | memoryview) -> None:
        """Count the rows of a block; ignore rows up to the last tick counted, which are repeats.

        A logger that is killed between writing rows and moving the tail of the ring leaves rows
        in its part of the file that the next logger takes from the ring again.
        """
        rows = np.frombuffer(block, dtype="<i8").reshape(-1, self._width)
        if len(rows) and rows[0, 0] <= self._last_tick:  # the first field of a row is its tick
            rows = rows[rows[:, 0] > self._last_tick]
        if not len(rows):
            return
        floats = rows.view("<f8")
        self._last_tick = int(rows[-1, 0])
        self.ticks += len(rows)
        self.skipped = int(rows[-1, self._skipped])
        self.reason = int(rows[-1, self._reason])
        late = floats[:, self._lateness]
        self._latest = max(self._latest, float(late.max()))
        _count(self._late, late)
        _count(self._busy, floats[:, self._work])

    def result(self, clock: str, rate_hz: float, dropped: int, privileges: Any) -> dict[str, Any]:
        """Return the certificate as a mapping; times in microseconds."""
        certificate: dict[str, Any] = {
            "clock": clock,
            "rate_hz": rate_hz,
            "ticks": self.ticks,
            "skipped": self.skipped,
            "dropped_rows": dropped,
            "privileges": privileges,
        }
        if clock == "virtual":
            certificate["summary"] = (
                f"{self.ticks} ticks on the virtual clock, every one of exactly "
                f"{1e3 / rate_hz:g} ms; nothing can be late."
            )
            return certificate
        lateness = _summary(self._late) | {"max": self._latest * 1e6}
        certificate["lateness_us"] = lateness
        certificate["work_us"] = _summary(self._busy)
        refused = [name for name, why in (privileges or {}).items() if why]
        certificate["summary"] = (
            f"{self.ticks} ticks on the real clock at {rate_hz:g} Hz, {self.skipped} skipped, "
            f"{dropped} rows dropped; woke {lateness['p50']:.0f} us late at the median, "
            f"{lateness['p99']:.0f} us at the 99th percentile, "
            f"{lateness['max']:.0f} us at worst"
            + (f"; not granted: {', '.join(refused)}." if refused else ".")
        )
        return certificate


def _count(into: npt.NDArray[np.int64], seconds: npt.NDArray[np.float64]) -> None:
    if not seconds.any():  # the virtual clock
        into[0] += len(seconds)
        return
    bins = np.clip((seconds * 1e6).astype(np.int64), 0, _BINS - 1)
    counts = np.bincount(bins)  # only as long as the largest bin needs: most blocks use few bins
    into[: len(counts)] += counts


def _summary(counts: npt.NDArray[np.int64]) -> dict[str, float]:
    total = np.cumsum(counts)
    return {
        name: float(np.searchsorted(total, share * total[-1])) if total[-1] else 0.0
        for name, share in _PERCENTILES.items()
    }


BLOCK_ROWS = 1024  # taken at once; larger blocks are not faster
FLUSH_INTERVAL = 0.5  # s between flushes
RETRY_INTERVAL = 0.5  # s between attempts on a full disk
ORPHAN_TIMEOUT = 5.0  # s without a row and without a supervisor after which the log ends
IDLE_INTERVAL = 0.02  # s to sleep without a row; longer blocks cost less per row
_PERMANENT_ERRORS = {errno.EROFS, errno.EIO, errno.ESTALE, errno.EACCES, errno.EPERM, errno.ENODEV}
PRIVILEGES = "privileges.json"  # written by the supervisor when the loop reports
EXIT_ROWS_LOST = 74  # exit code: rows were lost to the disk
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3  # of the GNU C library's mallopt
_KEPT_BYTES = 1 << 25


class RunLogger:
    """Writes one part of the run's record."""

    def __init__(self, job: LoggerJob) -> None:
        self._job = job
        self._folder = Path(job.folder)
        self._folder_fd = open_folder(self._folder)
        self._lock = lock_consumer(job.ring)  # before reading the tail: its consumer may move it
        self._reader = RingReader(job.ring)
        self._certificate = TimingCertificate(job.rows.leaves)
        self._flushed = self._moved = time.monotonic()
        self._failing_since: float | None = None
        self._abandoned_folders: set[Path] = set()  # folders that the record had to leave
        self._head = 0  # head of the ring when it last moved
        self._count_earlier_parts(self._folder)
        self._texts: dict[str, bytes] = {}
        for name in (*job.attachments, STATUS):  # STATUS: so that a rescued run is listed correctly
            with suppress(OSError):  # the rows must be written even in an emptied folder
                self._texts[name] = (self._folder / name).read_bytes()
        attached = {name: text for name, text in self._texts.items() if name != STATUS}
        self._writer = RowWriter(
            self._folder / job.part,
            job.rows,
            attached,
            {"run": {"run": job.run, "mode": job.mode}},
            start_utc_ns=self._wait_start(),
        )

    def run(self) -> int:
        """Log until no more rows come; return the exit code."""
        quarter = self._reader.capacity // 4
        while not self._all_rows_taken():
            block = None if self._failing_since else self._reader.take(BLOCK_ROWS)
            if block:
                self._writer.append(block)
                self._certificate.add(block)
            waited = time.monotonic() - self._flushed
            if self._reader.uncommitted >= quarter or waited >= FLUSH_INTERVAL:
                self._flushed = time.monotonic()
                if not self._save(self._writer.flush) and not self._may_retry():
                    return EXIT_ROWS_LOST
            elif not block:
                time.sleep(IDLE_INTERVAL)
        for name, value in (("timing.json", self._timing()), ("status.json", self._status())):
            self._writer.attach(name, json.dumps(value, indent=2).encode())
        with suppress(OSError):  # of most runs there is none
            self._writer.attach(JOURNAL, (self._folder / JOURNAL).read_bytes())
        while not self._save(self._writer.finish):
            if not self._may_retry():
                return EXIT_ROWS_LOST
        if os.getppid() != self._job.supervisor:  # it died and left its socket
            with suppress(OSError):
                (self._folder / SOCKET).unlink()
        return 0

    def _wait_start(self) -> int:
        """Return the UTC of run time zero once the loop reports it; now if there never is a loop.

        The logger starts before the first tick, so that there is no moment in which the death of
        the supervisor would leave a loop without a logger.
        """
        ring = self._reader
        while (
            not ring.start_utc_ns and ring.state != ProducerState.FINISHED and not self._orphaned()
        ):
            time.sleep(IDLE_INTERVAL)
        return ring.start_utc_ns or time.time_ns()

    def _all_rows_taken(self) -> bool:
        finished = self._reader.state == ProducerState.FINISHED or self._orphaned()
        return finished and self._reader.pending == 0 and not self._failing_since

    def _orphaned(self) -> bool:
        """Return whether supervisor and loop are both gone, so that no more rows will come."""
        now = time.monotonic()
        if self._reader.head != self._head or os.getppid() == self._job.supervisor:
            self._head, self._moved = self._reader.head, now
        if now - self._moved > ORPHAN_TIMEOUT:
            self._reader.mark_finished()
            return True
        return False

    def _count_earlier_parts(self, folder: Path) -> None:
        """Add the rows of killed loggers: the certificate covers the whole run."""
        for path in mcap_parts(folder):
            with suppress(RunError):  # the logger of this part died before it wrote a row
                for block in mcap_file.blocks(mcap_file.scan(path), []):
                    self._certificate.add(repack_fields(block).tobytes())

    def _status(self) -> dict[str, Any]:
        """Return the end of the run, as far as its rows show."""
        reason = self._certificate.reason
        reasons = recorded_reasons(parse_json(self._texts.get("plan.json")))
        name = reasons.name(reason)
        return {
            "run": self._job.run,
            "mode": self._job.mode,
            "status": end_status(reason),
            "reason": name,
            "reason_text": reasons.text(name),
            "ticks": self._reader.head + self._reader.dropped,
            "dropped_rows": self._reader.dropped,
        }

    def _timing(self) -> dict[str, Any]:
        privileges = self._folder / PRIVILEGES
        until = time.monotonic() + 2.0  # a very short loop ends before its supervisor writes
        while not privileges.exists() and time.monotonic() < until:
            time.sleep(IDLE_INTERVAL)
        granted = json.loads(privileges.read_text()) if privileges.exists() else None
        certificate = self._certificate.result(
            self._job.clock, self._job.rate_hz, self._reader.dropped, granted
        )
        return certificate | {
            "loop_waited_s": self._reader.waited_ns / 1e9,  # for space in the ring
            "logger_cpu_s": time.process_time(),  # of this logger, all threads
        }

    def _save(self, write: Callable[[], object]) -> bool:
        """Write to the record where it can be found; return False after a disk error."""
        try:
            self._follow_file()
            write()
        except OSError as error:
            self._set_disk_state(error.strerror or repr(error))
            # A rescue folder is tried at once: the rows are not safe before.
            return self._rescue_from_failed_disk(error) and self._save(write)
        self._reader.commit()
        self._set_disk_state("")
        return True

    def _follow_file(self) -> None:
        """Continue writing where the record can be found; raise OSError if that fails."""
        fd, part = self._writer.descriptor, self._job.part
        if refers_to(self._folder / part, fd):
            return
        moved = current_folder(self._folder_fd)
        if moved is not None and refers_to(moved / part, fd):
            self._folder = moved
            self._writer.path = moved / part
            report(RecordMoved(str(moved), "the run's folder was moved"))
        else:
            cause = "the run's folder was deleted" if moved is None else f"{part} was taken away"
            self._rescue(cause)

    def _rescue(self, why: str) -> None:
        if self._folder not in self._abandoned_folders:
            self._abandoned_folders.add(self._folder)
            report(RecordLost(why))  # before the copying, so that the rig stops at once
        part = self._job.part
        saved = save_to_rescue_folder(
            self._folder, self._texts, {part: self._writer.descriptor}, self._abandoned_folders
        )
        self._writer.switch_file(saved / part)
        os.close(self._folder_fd)
        self._folder, self._folder_fd = saved, open_folder(saved)
        with suppress(OSError):  # the lock of a run's folder, against a recovery meanwhile
            fcntl.flock(self._folder_fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        report(RecordMoved(str(saved), why))

    def _rescue_from_failed_disk(self, error: OSError) -> bool:
        """Save the record from a disk that fails for good; a full disk first gets its timeout."""
        if error.errno not in _PERMANENT_ERRORS and not self._disk_timed_out():
            return False
        with suppress(OSError):
            self._rescue(f"{self._folder} cannot be written ({error.strerror})")
            self._failing_since = time.monotonic()  # the rescue folder has its own timeout
            return True
        return False

    def _set_disk_state(self, error: str) -> None:
        """Report a disk that begins to fail or works again (empty error)."""
        if bool(error) != (self._failing_since is not None):
            self._failing_since = time.monotonic() if error else None
            report(DiskState(error))

    def _may_retry(self) -> bool:
        """Wait for the next attempt on a failing disk; return False after `disk_timeout_s`."""
        if self._disk_timed_out():
            return False
        time.sleep(RETRY_INTERVAL)
        return True

    def _disk_timed_out(self) -> bool:
        since = self._failing_since
        return since is not None and time.monotonic() - since > self._job.disk_timeout_s


def keep_freed_memory() -> None:
    """Make the C library keep freed memory for the next chunk, where it has `mallopt` (glibc).

    Otherwise the buffer of every compressed chunk comes from the system as new pages, at 0.3 us a
    row.
    """
    with suppress(AttributeError):
        set_option = ctypes.CDLL(None).mallopt
        set_option(_MMAP_THRESHOLD, _KEPT_BYTES)
        set_option(_TRIM_THRESHOLD, _KEPT_BYTES)


def main() -> None:
    """Run the job given on standard input."""
    keep_freed_memory()
    for number in (signal.SIGINT, signal.SIGHUP, signal.SIGTERM):  # it ends with the rows only
        signal.signal(number, signal.SIG_IGN)
    job: LoggerJob = handover.loads(LoggerJob, sys.stdin.read())
    sys.exit(RunLogger(job).run())


if __name__ == "__main__":
    main()
