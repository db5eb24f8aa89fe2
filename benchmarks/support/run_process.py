"""Run one campaign under the real supervisor, without products, in a process to be observed.

``python -m benchmarks.support.run_process CAMPAIGN RUNS virtual|interpreted|real [CORE]``, or ``hil
RIG [DEVICES]`` for emulated devices on a rig's wires, and another module of the loop's devices;
SIGTERM requests a controlled stop, a second one power off. With a core, supervisor, logger and loop
are confined to it. The clock of an interpreted loop is virtual.
"""

import json
import os
import sys
from pathlib import Path

from benchmarks.support.campaigns import SilentView, open_checked
from rig.execution.task import run_task
from rig.kinds.wavebot.tasks import execution_task, rehearsal_mode, wired_mode


def main() -> None:
    """Run the campaign of the command line, and print its folder and its outcome."""
    path, runs, clock, *more = sys.argv[1:]
    wires = clock == "hil"
    if more and not wires:
        os.sched_setaffinity(0, {int(more[0])})
    campaign, plan = open_checked(Path(path), rig=Path(more[0]) if wires else None)
    mode = (
        wired_mode(campaign, emulated=True)
        if wires
        else rehearsal_mode(campaign, real_clock=clock == "real")
    )
    mode = mode._replace(interpreted=clock == "interpreted")
    if wires and len(more) > 1:
        mode = mode._replace(device_module=more[1])
    result = run_task(execution_task(campaign, plan), Path(runs), SilentView(), mode)
    print(json.dumps({"folder": str(result.folder), **result.outcome._asdict()}))


if __name__ == "__main__":
    main()
