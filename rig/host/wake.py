"""A process that only wakes: the loop's clock and privileges without the loop's work.

``python -m rig.host.wake`` with a job as JSON on standard input; prints what it measured.
"""

import json
import os
import sys
from typing import Any

from rig.realtime import scheduling
from rig.realtime.clock import RealClock


def measure(dt: float, seconds: float, *, privileged: bool) -> dict[str, Any]:
    """Wake every ``dt`` s for so long; lateness in microseconds, periods skipped and elapsed.

    It asks for the very privileges the loop asks for, so it belongs in a process of its own.
    """
    granted = None
    if privileged:
        granted = scheduling.acquire()
    else:
        scheduling.quiet_memory()
    periods = max(1, round(seconds / dt))
    late = [0.0] * periods
    woken = skipped = longest = tick = 0
    clock = RealClock(dt)
    while tick < periods - 1:
        wake = clock.wait_next()
        tick = wake.tick
        late[woken] = wake.lateness
        woken += 1
        skipped += wake.periods - 1
        longest = max(longest, wake.periods - 1)
    ordered = sorted(late[:woken])
    return {
        "granted": granted and granted._asdict(),
        "core": max(os.sched_getaffinity(0)) if privileged else None,
        "wakes": woken,
        "skipped": skipped,
        "longest_gap": longest,
        "p50_us": 1e6 * ordered[woken // 2],
        "p99_us": 1e6 * ordered[min(woken - 1, (99 * woken) // 100)],
        "max_us": 1e6 * ordered[-1],
    }


def main() -> None:
    """Do the job on standard input."""
    job = json.load(sys.stdin)
    print(json.dumps(measure(job["dt"], job["seconds"], privileged=job["privileged"])))


if __name__ == "__main__":
    main()
