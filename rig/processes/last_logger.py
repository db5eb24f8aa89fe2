"""The logger of a loop whose supervisor is gone: every row reaches the disk before the loop ends.

The rows are in a ring that lives as long as a process holds it. If supervisor and logger are both
dead, the loop's process is the last one. Once the devices are stopped, it starts a logger itself
and waits for it. In every case it writes the ring's counters to the run's folder.
"""

import os
import subprocess
import time
from contextlib import suppress
from pathlib import Path

from rig.processes import handover
from rig.processes.child import start_process
from rig.processes.messages import LoggerJob
from rig.realtime.loop import LoopResult
from rig.recording.folder_watch import (
    current_folder,
    open_folder,
    save_to_rescue_folder,
    write_progress,
)
from rig.recording.ring import RingWriter, has_consumer

STALL_TIMEOUT_S = 3.0  # s without a saved row after which a logger is started
HANG_TIMEOUT_S = 60.0  # s without a saved row after which a logger is killed, as in the supervisor
MAX_STARTS = 3
SUPERVISED_TIMEOUT_S = 5.0  # s that the loop waits for the logger of a living supervisor
POLL_INTERVAL_S = 0.05  # s


class LastLogger:
    """Starts a logger in the place of a supervisor that is gone.

    ``job``: the logger's job as the supervisor gave it; None: unsaved rows are lost.
    """

    def __init__(self, job: LoggerJob | None, supervisor: int) -> None:
        self._job = job
        self._supervisor = supervisor
        self._process: subprocess.Popen[str] | None = None
        self._starts = 0

    @property
    def orphaned(self) -> bool:
        """Whether the supervisor is gone."""
        return os.getppid() != self._supervisor

    @property
    def _running(self) -> bool:
        """Whether a logger that was started here lives."""
        return self._process is not None and self._process.poll() is None

    def ensure_logger(self) -> bool:
        """Start a logger if an orphaned loop has none; return whether one works, whoever's it is.

        Returns False while the supervisor lives.
        """
        if self._job is None or not self.orphaned:
            return False
        if self._running or has_consumer(self._job.ring):
            return True
        if self._starts >= MAX_STARTS:
            return False
        self._starts += 1
        with suppress(OSError):
            self._process = self._start(self._job)
            return True
        return False

    def save_remaining_rows(self, ring: RingWriter, end: LoopResult | None) -> None:
        """Wait until every row is saved or no more can be; start a logger if necessary.

        Returns at once if there is no job.
        ``end``: how the loop ended; None if its own code failed.
        """
        if self._job is None:
            return
        tail, since, progress_written = ring.tail, time.monotonic(), False
        while ring.tail < ring.head and not ring.abandoned:
            stalled_s = time.monotonic() - since
            if ring.tail != tail:
                tail, since = ring.tail, time.monotonic()
            elif not self.orphaned:
                if stalled_s > SUPERVISED_TIMEOUT_S:
                    return  # the supervisor watches its logger and holds the ring as well
            elif not progress_written:
                progress_written = True
                self._write_progress(self._job, ring, end)
            elif stalled_s > HANG_TIMEOUT_S and self._process is not None and self._running:
                self._process.kill()
                self._process.wait()
                since = time.monotonic()
            elif stalled_s > STALL_TIMEOUT_S:
                started = self._starts
                if not self.ensure_logger() or (stalled_s > HANG_TIMEOUT_S and not self._running):
                    break  # a hanging logger of the supervisor keeps the ring, with all rows
                if self._starts > started:
                    since = time.monotonic()
            time.sleep(POLL_INTERVAL_S)
        if self._process is not None:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(HANG_TIMEOUT_S)
        if self.orphaned:
            self._write_progress(self._job, ring, end)

    def _write_progress(self, job: LoggerJob, ring: RingWriter, end: LoopResult | None) -> None:
        progress: dict[str, int | str | None] = {"final": True, "ticks": ring.head + ring.dropped}
        progress |= {"dropped": ring.dropped, "saved": ring.tail}
        if end is not None:
            progress |= {"last_tick": end.ticks + end.skipped - 1, "skipped": end.skipped}
            progress |= {"reason": end.reason}
        with suppress(OSError):
            fd = open_folder(_folder(job))
            write_progress(fd, **progress)
            os.close(fd)

    def _start(self, job: LoggerJob) -> "subprocess.Popen[str]":
        folder = _folder(job)
        stem = "run.mcap.part"
        parts = (path.name.removeprefix(stem) for path in folder.glob(f"{stem}*"))
        number = max((int(text) for text in parts if text.isdigit()), default=-1) + 1
        job = job._replace(supervisor=os.getpid(), folder=str(folder), part=f"{stem}{number}")
        fds = (job.ring, job.folder_lock)
        return start_process(
            "rig.processes.logger", handover.dumps(job), fds, folder / "logger.stderr"
        )


def _folder(job: LoggerJob) -> Path:
    """Return the present path of the run's folder; of a rescue folder if it was deleted."""
    return current_folder(job.folder_lock) or save_to_rescue_folder(Path(job.folder), {}, {})
