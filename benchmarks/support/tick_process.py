"""Time the parts of a loop with the simulated plant, in this process.

``python -m benchmarks.support.tick_process CAMPAIGN virtual|real SECONDS``: on the real clock it
requests the real-time privileges first and reports the refused ones. Prints one JSON object.
"""

import json
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from time import perf_counter
from typing import Any

from benchmarks.support.recorded import LoopParts, build_loop_parts
from benchmarks.support.result import quantile
from benchmarks.support.tick_timing import PARTS, Stamps, TimedDevices, TimedWriter
from rig.kinds.wavebot.tick import KIND
from rig.processes import mailbox
from rig.processes.mailbox import Mailbox, Request
from rig.processes.wire_locks import REALTIME_WIRE, acquire
from rig.realtime import loop, safety, scheduling
from rig.realtime.clock import Clock, RealClock, VirtualClock
from rig.recording import ring


def run_loop(
    loop_parts: LoopParts, clocks: Callable[[float], Clock], seconds: float, stamps: Stamps | None
) -> tuple[int, float]:
    """Run the loop for ``seconds``; return the number of ticks and the seconds they took."""
    ring_fd, mail_fd = ring.create(KIND.row_type), mailbox.create()
    devices: Any = loop_parts.connect()
    with suppress(OSError):  # allocate all pages, as in a loop that has run for a minute
        os.posix_fallocate(ring_fd, 0, os.fstat(ring_fd).st_size)
    if stamps is None:
        writer = ring.RingWriter(ring_fd, KIND.row_type, wait=False)
    else:
        writer = TimedWriter(ring_fd, KIND.row_type, stamps)
        devices = TimedDevices(devices, stamps)
    end_tick = round(seconds / loop_parts.plan.dt)
    if end_tick > ring.CAPACITY - 4096:
        raise ValueError(f"this ring has no reader: at most {ring.CAPACITY - 4096} ticks")

    def stop_request() -> int:
        return safety.REQUEST_ABORT if clock.now() >= seconds else 0

    clock = clocks(loop_parts.plan.dt)  # last: it runs from here on
    began = perf_counter()
    end = loop.run(
        KIND,
        loop_parts.params,
        devices,
        clock,
        writer,
        Mailbox(mail_fd, Request),
        stop_request,
        measure_work=False,
    )
    took = perf_counter() - began
    os.close(ring_fd)
    os.close(mail_fd)
    return end.ticks, took


def main() -> None:
    """Time one loop, and print the cost of each part of its ticks."""
    campaign, clock_name, seconds = Path(sys.argv[1]), sys.argv[2], float(sys.argv[3])
    loop_parts = build_loop_parts(campaign)
    stamps, refused = Stamps(), []
    if clock_name == "real":
        lock = acquire((REALTIME_WIRE,), "a benchmark")
        refused = list(scheduling.acquire().refused)
        run_loop(loop_parts, RealClock, seconds, stamps)
        lock.close()
    else:
        scheduling.freeze_garbage_collector()
        run_loop(loop_parts, VirtualClock, seconds, stamps)
    times = stamps.tick_times()
    statistics = {
        name: {
            "mean": float(values.mean()),
            **{f"p{share:g}": quantile(values, share / 100) for share in (50, 99, 99.9)},
        }
        for name, values in zip(PARTS, times, strict=True)
    }
    print(json.dumps({"refused": refused, "ticks": len(times.cycle), "us": statistics}))


if __name__ == "__main__":
    main()
