"""A process that measures wake-ups: the loop's clock and privileges without the loop's work.

``python -m rig.host.wake`` reads its options as JSON from standard input, and prints the result
as JSON.
"""

import json
import os
import sys
from typing import Any

from rig.realtime import scheduling
from rig.realtime.clock import RealClock


def measure(dt: float, seconds: float, *, privileged: bool) -> dict[str, Any]:
    """Wake every ``dt`` s for ``seconds``; return lateness (us) and periods skipped and elapsed.

    With ``privileged`` it acquires the same privileges as the loop, so it needs a process of its
    own.
    """
    granted = None
    if privileged:
        granted = scheduling.acquire()
    else:
        scheduling.freeze_garbage_collector()
    periods = max(1, round(seconds / dt))
    lateness = [0.0] * periods
    wakes = skipped = longest_gap = tick = 0
    clock = RealClock(dt)
    while tick < periods - 1:
        wake = clock.wait_next()
        tick = wake.tick
        lateness[wakes] = wake.lateness
        wakes += 1
        skipped += wake.periods - 1
        longest_gap = max(longest_gap, wake.periods - 1)
    ordered = sorted(lateness[:wakes])
    return {
        "granted": granted and granted._asdict(),
        "core": max(os.sched_getaffinity(0)) if privileged else None,
        "wakes": wakes,
        "skipped": skipped,
        "longest_gap": longest_gap,
        "p50_us": 1e6 * ordered[wakes // 2],
        "p99_us": 1e6 * ordered[min(wakes - 1, (99 * wakes) // 100)],
        "max_us": 1e6 * ordered[-1],
    }


def main() -> None:
    """Measure with the options on standard input, and print the result."""
    options = json.load(sys.stdin)
    result = measure(options["dt"], options["seconds"], privileged=options["privileged"])
    print(json.dumps(result))


if __name__ == "__main__":
    main()
