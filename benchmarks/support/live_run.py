"""A run of its own, watched from outside: its processes, their memory and time, its ring.

The ring is looked into through the supervisor's file descriptor, so nothing in the run knows that
it is watched, and what was put into it can still be counted after every process of it was killed.
"""

import json
import os
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

from benchmarks.support.recorded import ROOT
from rig.processes.wire_locks import REALTIME_WIRE, acquire
from rig.recording.ring import ProducerState, RingReader
from rig.recording.runs.create import BusyError

LOOP, LOGGER = "rig.processes.loop_process", "rig.processes.logger"
TIMEOUT = 60.0  # s


class TickObservation(NamedTuple):
    """The newest tick, seen from outside."""

    time: float  # s, monotonic clock
    tick: int


class TimeOutError(RuntimeError):
    """Something that had to happen did not."""


def wait_until(condition: Callable[[], bool], description: str, interval: float = 0.005) -> None:
    """Poll until ``true()``; TimeOutError after a minute."""
    end = time.monotonic() + TIMEOUT
    while not condition():
        if time.monotonic() > end:
            raise TimeOutError(f"not within {TIMEOUT:g} s: {description}")
        time.sleep(interval)


def is_running(pid: int) -> bool:
    """Whether a process is there and has not ended, with all its threads.

    A first thread may be gone while others still hold the files.
    """
    try:
        threads = list(Path(f"/proc/{pid}/task").iterdir())
    except OSError:
        return False
    for thread in threads:
        with suppress(OSError):
            if (thread / "stat").read_text().rsplit(")", 1)[1].split()[0] not in ("Z", "X"):
                return True
    return False


def child_running(parent: int, module: str) -> int | None:
    """Process id of the child that runs ``python -m module``."""
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            stat = (entry / "stat").read_text().rsplit(")", 1)[1].split()
            words = (entry / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if stat[0] != "Z" and int(stat[1]) == parent and module.encode() in words:
            return int(entry.name)
    return None


def _runs(pid: int, module: str) -> bool:
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except (FileNotFoundError, ProcessLookupError):
        return False
    return module.encode() in words and is_running(pid)


def processor_time(pid: int) -> float | None:
    """Seconds a process has spent on a core; None when it is gone."""
    try:
        return int(Path(f"/proc/{pid}/schedstat").read_text().split()[0]) / 1e9
    except (OSError, IndexError):
        return None


def resident_bytes(pid: int) -> dict[str, int]:
    """Resident bytes of a process: private, mapped from files, shared, and all."""
    names = {"RssAnon": "private", "RssFile": "files", "RssShmem": "shared", "VmRSS": "all"}
    found = {}
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        key, _, rest = line.partition(":")
        if key in names:
            found[names[key]] = int(rest.split()[0]) * 1024
    return found


def open_ring(pid: int) -> RingReader | None:
    """A bystander's end of the ring that a process holds, None while there is none."""
    try:
        for entry in Path(f"/proc/{pid}/fd").iterdir():
            if "memfd:wec-rig-ring" in os.readlink(entry):
                fd = os.open(entry, os.O_RDWR | os.O_CLOEXEC)
                try:
                    return RingReader(fd)
                finally:
                    os.close(fd)
    except (OSError, ValueError):  # ended, or not complete yet
        return None
    return None


def wait_realtime_free() -> None:
    """Wait until no other real-time loop runs on this host: two would disturb each other."""

    def free() -> bool:
        try:
            acquire((REALTIME_WIRE,), "a benchmark").close()
        except BusyError:
            return False
        return True

    wait_until(free, "the host's real-time place to be free", interval=0.2)


class LiveRun:
    """A run in its own processes; everything it started has ended when the block is left."""

    def __init__(self, command: list[str], runs: Path, env: dict[str, str] | None = None) -> None:
        runs.mkdir(parents=True, exist_ok=True)
        self.runs = runs
        self._output = (runs / "words.txt").open("w+")
        self.start_time = time.monotonic()
        self.process = subprocess.Popen(
            command,
            cwd=ROOT,
            stdout=self._output,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, **(env or {})},
        )
        self._ring: RingReader | None = None
        self.known_children: dict[int, str] = {}  # children seen so far: process id and module

    def __enter__(self) -> "LiveRun":
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.children()
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        for pid, module in self.known_children.items():
            if _runs(pid, module):  # the number may have gone to another process
                os.kill(pid, signal.SIGKILL)
        self._output.close()

    @property
    def ring(self) -> RingReader:
        """The run's ring."""
        if self._ring is None:
            wait_until(self._ring_exists, f"a ring of rows ({self.last_output_line()})")
        assert self._ring is not None
        return self._ring

    def try_ring(self) -> RingReader | None:
        """The run's ring if there is one yet."""
        if self._ring is None:
            self._ring = open_ring(self.process.pid)
        return self._ring

    def _ring_exists(self) -> bool:
        if self.process.poll() is not None:
            raise TimeOutError(f"the run ended at once: {self.last_output_line()}")
        return self.try_ring() is not None

    def wait_started(self) -> TickObservation:
        """Wait for the first tick."""

        def started() -> bool:
            if self.process.poll() is not None and self.ring.head == 0:
                raise TimeOutError(f"the run ended without a tick: {self.last_output_line()}")
            return self.ring.head > 0

        wait_until(started, "the first tick", interval=0.002)
        self.children()
        return self.observe_tick()

    def observe_tick(self) -> TickObservation:
        """The newest tick."""
        newest = self.ring.latest()
        if newest is None:
            raise TimeOutError(f"no row to be seen ({self.last_output_line()})")
        return TickObservation(time.monotonic(), struct.unpack_from("<q", newest)[0])

    def pid(self, module: str) -> int:
        """Process id of the loop or the logger as it is now."""
        found: int | None = None

        def look() -> bool:
            nonlocal found
            found = child_running(self.process.pid, module)
            return found is not None

        wait_until(look, f"a process of {module}", interval=0.01)
        assert found is not None
        self.known_children[found] = module
        return found

    def children(self) -> dict[str, int]:
        """Process ids of loop and logger by module, of those that live."""
        found = {module: child_running(self.process.pid, module) for module in (LOOP, LOGGER)}
        ours = {module: pid for module, pid in found.items() if pid is not None}
        self.known_children.update({pid: module for module, pid in ours.items()})
        return ours

    def stop(self) -> None:
        """Ask for the power to be taken off at once: the second request overrides the first."""
        self.process.send_signal(signal.SIGTERM)
        time.sleep(0.02)
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)

    def wait_ended(self) -> dict[str, Any]:
        """Wait for the supervisor's end; gives its outcome."""
        wait_until(lambda: self.process.poll() is not None, "the end of the run")
        if self.process.returncode != 0:
            raise TimeOutError(f"the run failed: {self.last_output_line()}")
        outcome: dict[str, Any] = json.loads(self.last_output_line())
        return outcome

    def last_output_line(self) -> str:
        """The last line the process has printed."""
        lines = Path(self._output.name).read_text().splitlines()
        return lines[-1].strip() if lines else "nothing said"

    @property
    def folder(self) -> Path:
        """The run's folder."""
        return next(path for path in self.runs.iterdir() if path.is_dir())

    def is_drained(self) -> bool:
        """The loop has ended and every row it put is safe on disk."""
        return self.ring.state == ProducerState.FINISHED and self.ring.tail == self.ring.head


def live_run(
    campaign: Path,
    runs: Path,
    *,
    real_clock: bool,
    core: int | None = None,
    env: dict[str, str] | None = None,
) -> LiveRun:
    """Start a campaign under the real supervisor."""
    clock = "real" if real_clock else "virtual"
    if real_clock:
        wait_realtime_free()
    confined = [] if core is None else [str(core)]
    module = "benchmarks.support.run_process"
    return LiveRun(
        [sys.executable, "-m", module, str(campaign), str(runs), clock, *confined], runs, env
    )
