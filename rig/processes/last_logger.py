"""The loop's own end when its supervisor is gone: no row leaves memory before it is on the disk.

The rows are in a ring that lives as long as a process holds it. If supervisor and logger are both
dead, the loop's process is the last one: once the devices are stopped it starts a logger itself and
waits for it. Whatever comes of that, what the ring knows is noted in the run's folder.
"""

import json
import os
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from rig.realtime.loop import LoopResult
from rig.realtime.safety import Reason
from rig.recording.folder_watch import current_folder, save_to_rescue_folder, write_progress
from rig.recording.ring import RingWriter, has_consumer

STUCK = 3.0  # s without a row saved after which a logger is started
HANGS = 60.0  # s after which one that saves nothing is killed, as the supervisor has it
ATTEMPTS = 3
LIVING = 5.0  # s that a living supervisor's logger is waited for
POLL = 0.05  # s


class LastLogger:
    """Starts a logger in the place of a supervisor that is gone.

    ``request``: JSON with ``job``, the logger's job by field, and the descriptors of the ``folder``
    (-1: none) and the ``ring``.
    """

    def __init__(self, request: str, supervisor: int) -> None:
        self._request: dict[str, Any] = json.loads(request) if request else {}
        self._supervisor = supervisor
        self._process: subprocess.Popen[str] | None = None
        self._started = 0

    @property
    def alone(self) -> bool:
        """The supervisor is gone."""
        return os.getppid() != self._supervisor

    @property
    def _works(self) -> bool:
        """A logger that was started here lives."""
        return self._process is not None and self._process.poll() is None

    def helps(self) -> bool:
        """Whether a logger is at work, of the supervisor or started here; starts one if need be."""
        if not self._request or not self.alone:
            return False
        if self._works or has_consumer(self._request["ring"]):
            return True
        if self._started >= ATTEMPTS:
            return False
        self._started += 1
        with suppress(OSError):
            self._process = self._start()
            return True
        return False

    def see_out(self, ring: RingWriter, end: LoopResult | None) -> None:
        """Wait until every row is saved, if need be by a logger of our own, or none can be.

        Returns at once if there is no request.
        ``end``: how the loop ended; None if its own code failed.
        """
        if not self._request:
            return
        tail, since, noted = ring.tail, time.monotonic(), False
        while ring.tail < ring.head and not ring.abandoned:
            still = time.monotonic() - since
            if ring.tail != tail:
                tail, since = ring.tail, time.monotonic()
            elif not self.alone:
                if still > LIVING:
                    return  # it knows of its logger what is to be known, and has the ring as well
            elif not noted:
                noted = self._note(ring, end)
            elif still > HANGS and self._process is not None and self._works:
                self._process.kill()
                self._process.wait()
                since = time.monotonic()
            elif still > STUCK:
                started = self._started
                if not self.helps() or (still > HANGS and not self._works):
                    break  # a logger of the supervisor that hangs keeps the ring, with all rows
                if self._started > started:
                    since = time.monotonic()
            time.sleep(POLL)
        if self._process is not None:
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(HANGS)
        if self.alone:
            self._note(ring, end)

    def _note(self, ring: RingWriter, end: LoopResult | None) -> bool:
        known: dict[str, int | str | None] = {"final": True, "ticks": ring.head + ring.dropped}
        known |= {"dropped": ring.dropped, "saved": ring.tail}
        if end is not None:
            known |= {"last_tick": end.ticks + end.skipped - 1, "skipped": end.skipped}
            known |= {"reason": Reason(end.reason).name}
        with suppress(OSError):
            fd = os.open(self._folder(), os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
            write_progress(fd, **known)
            os.close(fd)
        return True

    def _folder(self) -> Path:
        """Where the run's folder is now; another one if it was deleted."""
        folder, fd = Path(self._request["job"]["folder"]), int(self._request["folder"])
        if fd < 0:
            return folder
        return current_folder(fd) or save_to_rescue_folder(folder, {}, {})

    def _start(self) -> "subprocess.Popen[str]":
        folder = self._folder()
        stem = "run.mcap.part"
        parts = (path.name.removeprefix(stem) for path in folder.glob(f"{stem}*"))
        number = max((int(text) for text in parts if text.isdigit()), default=-1) + 1
        changed = {"supervisor": os.getpid(), "folder": str(folder), "part": f"{stem}{number}"}
        job = {**self._request["job"], **changed}
        fds = tuple(fd for fd in (self._request["ring"], self._request["folder"]) if fd >= 0)
        with (folder / "logger.stderr").open("ab") as errors:
            process = subprocess.Popen(
                [sys.executable, "-m", "rig.recording.logger"],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=errors,
                pass_fds=fds,
                text=True,
                process_group=0,
            )
        assert process.stdin is not None
        with suppress(BrokenPipeError):
            process.stdin.write(json.dumps(list(job.values())))
            process.stdin.close()
        return process
