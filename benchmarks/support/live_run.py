"""A run in its own processes, observed from outside: processes, their memory and time, the ring.

The ring is opened through the supervisor's file descriptor, so the run is not affected, and its
rows can be counted even after every process of the run was killed.
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
    """The newest tick at a time."""

    time: float  # s, monotonic clock
    tick: int


class TimeOutError(RuntimeError):
    """An expected event has not happened in time."""


def wait_until(condition: Callable[[], bool], description: str, interval: float = 0.005) -> None:
    """Poll until ``true()``; TimeOutError after a minute."""
    end = time.monotonic() + TIMEOUT
    while not condition():
        if time.monotonic() > end:
            raise TimeOutError(f"not within {TIMEOUT:g} s: {description}")
        time.sleep(interval)


def is_running(pid: int) -> bool:
    """Return True if a process exists and any of its threads runs.

    The first thread may have ended while others still hold the files open.
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
    """Return the process id of the child that runs ``python -m module``; None if there is none."""
    for entry in Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            stat = (entry / "stat").read_text().rsplit(")", 1)[1].split()
            arguments = (entry / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
        if stat[0] != "Z" and int(stat[1]) == parent and module.encode() in arguments:
            return int(entry.name)
    return None


def _runs(pid: int, module: str) -> bool:
    try:
        arguments = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except (FileNotFoundError, ProcessLookupError):
        return False
    return module.encode() in arguments and is_running(pid)


def processor_time(pid: int) -> float | None:
    """Return the processor time (s) of all threads of a process; None if it has ended."""
    try:  # the file of the process itself counts its main thread alone
        threads = Path(f"/proc/{pid}/task").iterdir()
        return sum(int((each / "schedstat").read_text().split()[0]) for each in threads) / 1e9
    except (OSError, IndexError):
        return None


def resident_bytes(pid: int) -> dict[str, int]:
    """Return the resident bytes of a process: private, mapped from files, shared, and all."""
    names = {"RssAnon": "private", "RssFile": "files", "RssShmem": "shared", "VmRSS": "all"}
    resident = {}
    for line in Path(f"/proc/{pid}/status").read_text().splitlines():
        key, _, rest = line.partition(":")
        if key in names:
            resident[names[key]] = int(rest.split()[0]) * 1024
    return resident


def open_ring(pid: int) -> RingReader | None:
    """Open the ring that a process holds, for reading; None if it has none."""
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
    """A run in its own processes, as a context manager that kills remaining processes on exit."""

    def __init__(self, command: list[str], runs: Path, env: dict[str, str] | None = None) -> None:
        runs.mkdir(parents=True, exist_ok=True)
        self.runs = runs
        self._output = (runs / "output.txt").open("w+")
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
        self.known_children: dict[int, str] = {}  # process id: module, of all children seen so far

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
            if _runs(pid, module):  # the id may belong to another process now
                os.kill(pid, signal.SIGKILL)
        self._output.close()

    @property
    def ring(self) -> RingReader:
        """The run's ring; waits for it."""
        if self._ring is None:
            wait_until(self._ring_exists, f"a ring of rows ({self.last_output_line()})")
        assert self._ring is not None
        return self._ring

    def try_ring(self) -> RingReader | None:
        """Return the run's ring; None if it does not exist yet."""
        if self._ring is None:
            self._ring = open_ring(self.process.pid)
        return self._ring

    def _ring_exists(self) -> bool:
        if self.process.poll() is not None:
            raise TimeOutError(f"the run ended at once: {self.last_output_line()}")
        return self.try_ring() is not None

    def wait_started(self) -> TickObservation:
        """Wait for the first tick; return the newest one."""

        def started() -> bool:
            if self.process.poll() is not None and self.ring.head == 0:
                raise TimeOutError(f"the run ended without a tick: {self.last_output_line()}")
            return self.ring.head > 0

        wait_until(started, "the first tick", interval=0.002)
        self.children()
        return self.observe_tick()

    def observe_tick(self) -> TickObservation:
        """Return the newest tick and the present time."""
        newest = self.ring.latest()
        if newest is None:
            raise TimeOutError(f"no row in the ring ({self.last_output_line()})")
        return TickObservation(time.monotonic(), struct.unpack_from("<q", newest)[0])

    def pid(self, module: str) -> int:
        """Wait for the loop or the logger; return its process id."""
        pid: int | None = None

        def exists() -> bool:
            nonlocal pid
            pid = child_running(self.process.pid, module)
            return pid is not None

        wait_until(exists, f"a process of {module}", interval=0.01)
        assert pid is not None
        self.known_children[pid] = module
        return pid

    def children(self) -> dict[str, int]:
        """Return the process ids of the running loop and logger by module."""
        pids = {module: child_running(self.process.pid, module) for module in (LOOP, LOGGER)}
        running = {module: pid for module, pid in pids.items() if pid is not None}
        self.known_children.update({pid: module for module, pid in running.items()})
        return running

    def stop(self) -> None:
        """Request power off at once: the second signal overrides the controlled stop."""
        self.process.send_signal(signal.SIGTERM)
        time.sleep(0.02)
        if self.process.poll() is None:
            self.process.send_signal(signal.SIGTERM)

    def wait_ended(self) -> dict[str, Any]:
        """Wait for the end of the supervisor; return its outcome."""
        wait_until(lambda: self.process.poll() is not None, "the end of the run")
        if self.process.returncode != 0:
            raise TimeOutError(f"the run failed: {self.last_output_line()}")
        outcome: dict[str, Any] = json.loads(self.last_output_line())
        return outcome

    def last_output_line(self) -> str:
        """Return the last line that the process has printed."""
        lines = Path(self._output.name).read_text().splitlines()
        return lines[-1].strip() if lines else "no output"

    @property
    def folder(self) -> Path:
        """The run folder."""
        return next(path for path in self.runs.iterdir() if path.is_dir())

    def is_drained(self) -> bool:
        """Return True if the loop has ended and every row that it put is saved on disk."""
        return self.ring.state == ProducerState.FINISHED and self.ring.tail == self.ring.head


def live_run(
    campaign: Path,
    runs: Path,
    *,
    real_clock: bool,
    interpreted: bool = False,
    core: int | None = None,
    env: dict[str, str] | None = None,
) -> LiveRun:
    """Start a campaign under the real supervisor, optionally confined to one core.

    An interpreted loop has the virtual clock.
    """
    clock = "real" if real_clock else "interpreted" if interpreted else "virtual"
    if real_clock:
        wait_realtime_free()
    core_option = [] if core is None else [str(core)]
    module = "benchmarks.support.run_process"
    return LiveRun(
        [sys.executable, "-m", module, str(campaign), str(runs), clock, *core_option], runs, env
    )
