"""Runs on real wires whose processes are looked into, stopped and killed from outside."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.support.fault_walk import Trigger, Watcher, when_free
from benchmarks.support.process_faults import beside
from rig.execution.campaign import Ended, carry_out, wired
from rig.planning.campaign import Campaign, Plan
from rig.processes.run_types import Snapshot


def children() -> set[str]:
    """Files of errors of all our children that are not dead."""
    found = set()
    for entry in Path("/proc").iterdir():
        try:
            stat = (entry / "stat").read_text().rsplit(")", 1)[1].split()
            if int(stat[1]) == os.getpid() and stat[0] != "Z":
                found.add(Path(os.readlink(entry / "fd" / "2")).name)
        except (OSError, ValueError, IndexError):
            continue
    return found


class Kill(Trigger):
    """kill -9 of one process when the motors have had power for a second."""

    def __init__(self, stderr: str) -> None:
        def deed() -> float:
            os.kill(beside(stderr), signal.SIGKILL)
            return time.monotonic()

        super().__init__(deed, 1.0)


def emulated(
    campaign: Campaign, plan: Plan, runs: Path, see: Callable[[Snapshot], None] | None = None
) -> Ended:
    """A run that starts its own emulated devices."""

    def run() -> Ended:
        watcher = Watcher(see or (lambda snapshot: None))
        return carry_out(campaign, plan, runs, watcher, wired(campaign, emulated=True))

    return when_free(run)
