"""The process that compiles a tick beside a run, and the supervisor's side of it.

A run never waits for the compiler: its loop begins interpreted and goes over to the compiled tick
as soon as the code is in the cache. The process has the lowest priority and ends with the run.
"""

import fcntl
import importlib
import os
import sys
from contextlib import suppress
from pathlib import Path

from rig.compilation.cache_folder import mark_used
from rig.compilation.tick_source import tick_source
from rig.processes import handover
from rig.processes.child import start_process
from rig.processes.io_process import ignore_terminal_signals
from rig.processes.messages import CompileJob
from rig.processes.run_types import Task
from rig.realtime.compiled_tick import is_complete

MODULE = "rig.processes.tick_compiler"
_LOWEST_PRIORITY = 19
_COMPILER_S = 30.0  # s that the compiler takes beside a run on two cores
_INTERPRETED_TICK_S = 50e-6  # s of an interpreted tick of a rehearsal


class TickCompiler:
    """The code of a task's tick: in the cache, or being compiled."""

    def __init__(self, task: Task, errors: Path, *, real_clock: bool) -> None:
        """Find the code or start its compilation, whose errors are appended to a file.

        A run that ends before the compiler does is not compiled for.
        """
        self.folder = ""  # of the code; empty for a tick that cannot be compiled
        self._process = None
        try:
            folder = tick_source(task.tick, task.law, task.params, task.dt).folder
        except Exception:  # noqa: BLE001  a law may raise anything in its example tick; so may the loop
            return
        self.folder = str(folder)
        if is_complete(folder):
            mark_used(folder)
            return
        ticks = sum(task.params.segments.ticks)
        if ticks * (task.dt if real_clock else _INTERPRETED_TICK_S) > _COMPILER_S:
            job = CompileJob(task.params, task.dt, task.law)
            self._process = start_process(MODULE, handover.dumps(job), (), errors, task.tick)

    def end(self) -> None:
        """End a compilation that still runs."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()


def main(tick: str) -> None:
    """Compile the tick of the job on standard input, unless another process compiles it."""
    ignore_terminal_signals()
    os.nice(_LOWEST_PRIORITY)
    text = sys.stdin.read()
    kind = importlib.import_module(tick).find_kind(handover.read_field(CompileJob, text, "law"))
    job: CompileJob = handover.loads(CompileJob, text, rig=kind.params_type, **dict(kind.any_types))
    source = tick_source(tick, job.law, job.params, job.dt)
    with suppress(OSError):  # a cache that cannot be written
        source.folder.mkdir(parents=True, exist_ok=True)
        with (source.folder / "lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)  # the first of several processes compiles
            from rig.compilation.tick_code import CompilationError, compile_tick  # noqa: PLC0415

            try:
                compile_tick(source)
            except CompilationError as error:
                sys.exit(f"the tick runs interpreted, it cannot be compiled: {error}")


if __name__ == "__main__":
    main(sys.argv[1])
