"""Time the parts of a loop with the simulated plant on the real clock, in this process.

``python -m benchmarks.support.tick_process CAMPAIGN interpreted|compiled SECONDS``: it requests the
real-time privileges first and reports the refused ones. Prints one JSON object.
"""

import json
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import Any

from benchmarks.support.recorded import LoopParts, build_loop_parts
from benchmarks.support.result import quantile
from benchmarks.support.tick_timing import PARTS, Stamps, TimedDevices, TimedWriter
from rig import laws
from rig.compilation.tick_source import TickSource, tick_source
from rig.kinds.wavebot.tick import KIND
from rig.processes import mailbox
from rig.processes.mailbox import LoopMailbox
from rig.processes.wire_locks import REALTIME_WIRE, acquire
from rig.realtime import cycle, loop, safety, scheduling
from rig.realtime.clock import RealClock
from rig.recording import ring

_FIRST_S = 1.0  # s left out: the code is loaded, caches are filled


def tick_source_of(params: cycle.Params, dt: float) -> TickSource:
    """Return the source of the WaveBot's ticks with its impedance law."""
    return tick_source("rig.kinds.wavebot.tick", laws.to_request(laws.own("impedance")), params, dt)


def run_loop(loop_parts: LoopParts, seconds: float, stamps: Stamps, code: Path | None) -> None:
    """Run the loop for ``seconds``, with compiled ticks if ``code`` is their folder."""
    ring_fd, mail_fd = ring.create(KIND.row_type), mailbox.create()
    devices: Any = loop_parts.connect()
    with suppress(OSError):  # allocate all pages, as in a loop that has run for a minute
        os.posix_fallocate(ring_fd, 0, os.fstat(ring_fd).st_size)
    writer = TimedWriter(ring_fd, KIND.row_type, stamps)
    devices = TimedDevices(devices, stamps)
    end_tick = round(seconds / loop_parts.plan.dt)
    if end_tick > ring.CAPACITY - 4096:
        raise ValueError(f"this ring has no reader: at most {ring.CAPACITY - 4096} ticks")

    def stop_request() -> int:
        return safety.REQUEST_ABORT if clock.now() >= seconds else 0

    clock = RealClock(loop_parts.plan.dt)  # last: it runs from here on
    end = loop.run(
        KIND,
        loop_parts.params,
        devices,
        clock,
        writer,
        LoopMailbox(mail_fd, -1, ()),
        stop_request,
        measure_work=False,
        code=code,
    )
    os.close(ring_fd)
    os.close(mail_fd)
    if code is not None and not 0 < end.compiled_from < _FIRST_S / loop_parts.plan.dt:
        raise RuntimeError(f"the ticks were not compiled in time: {end}")


def main() -> None:
    """Time one loop, and print the cost of each part of its ticks."""
    campaign, execution, seconds = Path(sys.argv[1]), sys.argv[2], float(sys.argv[3])
    loop_parts = build_loop_parts(campaign)
    params, dt = loop_parts.params, loop_parts.plan.dt
    code = tick_source_of(params, dt).folder if execution == "compiled" else None
    stamps = Stamps()
    lock = acquire((REALTIME_WIRE,), "a benchmark")
    refused = list(scheduling.acquire().refused)
    run_loop(loop_parts, _FIRST_S + seconds, stamps, code)
    lock.close()
    times = stamps.tick_times(round(_FIRST_S / dt))
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
