"""Runs on real wires: the execution of their tick, and processes that are killed from outside."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from rig.compilation.tick_code import compile_tick
from rig.execution.emulated_rig import EmulatedRig
from rig.execution.fault_runs import CallbackView, Trigger, run_when_free
from rig.execution.process_faults import child_with_stderr
from rig.execution.task import RunResult, run_task
from rig.kinds.wavebot.campaign import Campaign, Plan
from rig.kinds.wavebot.tasks import execution_task, wired_mode
from rig.processes.run_types import Snapshot
from rig.processes.tick_compiler import compile_job, source_of

EXECUTIONS = ("compiled", "interpreted")


def in_execution(on: Any, execution: str) -> Any:
    """Return an emulated rig whose runs have an execution of the tick; its code is in the cache."""
    if execution == "compiled":
        compile_tick(source_of(on.task.tick, compile_job(on.task)))
    return on._replace(interpreted=execution == "interpreted")


def assert_executed(result: RunResult, execution: str) -> None:
    """Assert that a run that was not refused had this execution of the tick from its tare on."""
    first, ended = result.outcome.compiled_from, result.outcome.status
    if ended not in ("refused", "crashed"):  # without a report of the loop
        assert 0 < first < 1000 if execution == "compiled" else first == -1


def child_error_files() -> set[str]:
    """Return the names of the error files of all living children of this process."""
    names = set()
    for entry in Path("/proc").iterdir():
        try:
            stat = (entry / "stat").read_text().rsplit(")", 1)[1].split()
            if int(stat[1]) == os.getpid() and stat[0] != "Z":
                names.add(Path(os.readlink(entry / "fd" / "2")).name)
        except (OSError, ValueError, IndexError):
            continue
    return names


class Kill(Trigger):
    """Kills one process with SIGKILL after the motors have had power for one second."""

    def __init__(self, stderr: str) -> None:
        def kill() -> float:
            os.kill(child_with_stderr(stderr), signal.SIGKILL)
            return time.monotonic()

        super().__init__(kill, 1.0)


def run_emulated(
    campaign: Campaign,
    plan: Plan,
    runs: Path,
    on_snapshot: Callable[[Snapshot], None] | None = None,
) -> RunResult:
    """Run a campaign with emulated devices of its own and return the result."""

    def run() -> RunResult:
        view = CallbackView(on_snapshot or (lambda snapshot: None))
        return run_task(
            execution_task(campaign, plan), runs, view, wired_mode(campaign, emulated=True)
        )

    return run_when_free(run)


def restart_and_run(on: EmulatedRig, callback: Callable[[Snapshot], None]) -> RunResult:
    """Bring the devices to rest and run the task; ``callback`` gets each snapshot."""
    on.control.request("restart")
    return run_when_free(lambda: on.run(CallbackView(callback)))
