"""Runs on real wires whose processes are inspected, suspended and killed from outside."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.support.fault_runs import CallbackView, Trigger, run_when_free
from benchmarks.support.process_faults import child_with_stderr
from rig.execution.task import RunResult, run_task
from rig.kinds.wavebot.campaign import Campaign, Plan
from rig.kinds.wavebot.tasks import execution_task, wired_mode
from rig.processes.run_types import Snapshot


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
