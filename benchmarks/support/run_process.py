"""One campaign under the real supervisor, without products: a process to be watched.

``python -m benchmarks.support.run_process CAMPAIGN RUNS virtual|real [CORE]``; SIGTERM asks for a
controlled stop, a second one for power off. With a core, supervisor, logger and loop are confined
to it.
"""

import json
import os
import sys
from pathlib import Path

from rig.campaign import check
from rig.campaign_run import rehearse
from rig.supervisor import Snapshot


class _Unseen:
    """Draws nothing."""

    notice = ""

    def __call__(self, snapshot: Snapshot) -> None:
        pass


def main() -> None:
    """Run the campaign named on the command line and print how it ended."""
    campaign, runs, clock, *core = sys.argv[1:]
    if core:
        os.sched_setaffinity(0, {int(core[0])})
    report = check(Path(campaign))
    assert report.campaign is not None
    assert report.plan is not None
    ended = rehearse(
        report.campaign, report.plan, Path(runs), _Unseen(), real_clock=clock == "real"
    )
    print(json.dumps({"folder": str(ended.folder), **ended.outcome._asdict()}))


if __name__ == "__main__":
    main()
