"""One campaign under the real supervisor, without products: a process to be watched.

``python -m benchmarks.support.run_process CAMPAIGN RUNS virtual|real [CORE]``, or ``hil RIG`` for
emulated devices on a rig's wires; SIGTERM asks for a controlled stop, a second one for power off.
With a core, supervisor, logger and loop are confined to it.
"""

import json
import os
import sys
from pathlib import Path

from rig.execution.task import run_task
from rig.kinds.wavebot.campaign import check_campaign
from rig.kinds.wavebot.tasks import execution_task, rehearsal_mode, wired_mode
from rig.processes.run_types import Snapshot


class _Unseen:
    """Draws nothing."""

    notice = ""

    def __call__(self, snapshot: Snapshot) -> None:
        pass


def main() -> None:
    """Run the campaign named on the command line and print how it ended."""
    campaign, runs, clock, *more = sys.argv[1:]
    wires = clock == "hil"
    if more and not wires:
        os.sched_setaffinity(0, {int(more[0])})
    report = check_campaign(Path(campaign), rig=Path(more[0]) if wires else None)
    assert report.campaign is not None
    assert report.plan is not None
    mode = (
        wired_mode(report.campaign, emulated=True)
        if wires
        else rehearsal_mode(report.campaign, real_clock=clock == "real")
    )
    ended = run_task(execution_task(report.campaign, report.plan), Path(runs), _Unseen(), mode)
    print(json.dumps({"folder": str(ended.folder), **ended.outcome._asdict()}))


if __name__ == "__main__":
    main()
