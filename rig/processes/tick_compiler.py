"""The process that compiles a tick beside a run, and the supervisor's side of it.

A run never waits for the compiler: its loop begins interpreted and goes over to the compiled tick
as soon as the code is in the cache. The process has the lowest priority and ends with the run.
"""

import importlib
import os
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

from rig.compilation.cache_folder import remove_unused_code
from rig.compilation.tick_source import TickSource, tick_source
from rig.processes import handover
from rig.processes.child import start_process
from rig.processes.io_process import ignore_terminal_signals
from rig.processes.messages import CompileJob
from rig.processes.run_types import ExecutionMode, Task

MODULE = "rig.processes.tick_compiler"
_LOWEST_PRIORITY = 19
_WATCH_S = 1.0  # s between looks for the run
_COMPILER_S = 30.0  # s that the compiler takes beside a run on two cores
_INTERPRETED_TICK_S = 50e-6  # s of an interpreted tick of a rehearsal


class TickCompiler:
    """The code of a task's ticks, and the process that compiles it if it is missing."""

    def __init__(self, task: Task, mode: ExecutionMode, errors: Path) -> None:
        """The errors of the compiler are appended to a file."""
        self._task, self._mode, self._errors = task, mode, errors
        self._process: subprocess.Popen[str] | None = None
        self._thread: threading.Thread | None = None
        self._lock, self._ended = threading.Lock(), False
        self.folder = ""  # of the code of a tick alone; empty if it cannot be compiled
        if not mode.coupled:  # otherwise the loop process, which has the plant, finds it
            # A law may raise anything in its example tick; so may the loop.
            with suppress(Exception):
                self.folder = str(tick_source(task.tick, task.law, task.params, task.dt).folder)
        tick_s = task.dt if mode.real_clock else _INTERPRETED_TICK_S
        self.compiles = sum(task.params.segments.ticks) * tick_s > _COMPILER_S
        """Whether the run is longer than the compiler takes."""

    def start(self) -> None:
        """Compile the ticks if that is worth its time.

        It returns at once: the process reads its job only after its imports.
        """
        if self._thread is not None or not self.compiles:
            return
        job = compile_job(self._task, self._mode)
        self._thread = threading.Thread(target=self._start, args=(job,), daemon=True)
        self._thread.start()

    @property
    def running(self) -> bool:
        """Whether a compilation has begun and not ended."""
        with self._lock:
            process = self._process
        if process is not None:
            return process.poll() is None
        return self._thread is not None and self._thread.is_alive()

    def _start(self, job: CompileJob) -> None:
        text, tick = handover.dumps(job), self._task.tick
        with suppress(OSError):  # a full disk, or no more processes: the tick stays interpreted
            process = start_process(MODULE, text, (), self._errors, tick)
            with self._lock:
                self._process = process
                if self._ended:
                    process.kill()

    def end(self) -> None:
        """End a compilation that still runs, and start none any more."""
        self.compiles = False
        with self._lock:
            self._ended, process = True, self._process
        if process is not None:
            process.kill()
            process.wait()


def compile_job(task: Task, mode: ExecutionMode | None = None) -> CompileJob:
    """Return the job for a task's tick; for a mode that is coupled, together with its plant."""
    job = CompileJob(task.params, task.dt, task.law)
    if mode is None or not mode.coupled:
        return job
    return job._replace(device_module=mode.device_module, devices=mode.devices)


def source_of(tick: str, job: CompileJob) -> TickSource:
    """Return the source of a job; ValueError for ticks that cannot be compiled."""
    if not job.device_module:
        return tick_source(tick, job.law, job.params, job.dt)
    module = importlib.import_module(job.device_module)
    devices = module.connect(job.devices | {"compiled": False}, job.dt)
    source: TickSource = devices.coupled_source(tick, job.law, job.params)
    return source


def main(tick: str) -> None:
    """Compile the tick of the job on standard input, unless another process compiles it."""
    ignore_terminal_signals()
    threading.Thread(target=_end_with_the_run, args=(os.getppid(),), daemon=True).start()
    os.nice(_LOWEST_PRIORITY)
    text = sys.stdin.read()
    kind = importlib.import_module(tick).find_kind(handover.read_field(CompileJob, text, "law"))
    job: CompileJob = handover.loads(CompileJob, text, rig=kind.params_type, **dict(kind.any_types))
    source = source_of(tick, job)
    from rig.compilation.tick_code import CompilationError, compile_tick  # noqa: PLC0415

    try:
        compile_tick(source)
    except (CompilationError, OSError) as error:
        sys.exit(f"the tick runs interpreted, it cannot be compiled: {error}")
    remove_unused_code()


def _end_with_the_run(supervisor: int) -> None:
    """End this process after its supervisor was killed; files of the cache are written at once."""
    while os.getppid() == supervisor:
        time.sleep(_WATCH_S)
    os._exit(1)


if __name__ == "__main__":
    main(sys.argv[1])
