"""What one pure cycle costs: estimate, law, safety, limits and the row, no plant and no ring."""

import json
import subprocess
import sys
import tempfile
from array import array
from pathlib import Path
from time import perf_counter_ns, process_time_ns
from typing import Any, NamedTuple

from benchmarks.support.live_run import wait_realtime_free
from benchmarks.support.recorded import (
    ROOT,
    RecordedTicks,
    garbage_collection_off,
    record_ticks,
    write_campaign_file,
)
from benchmarks.support.reference_cpu import raw_and_normalised, reference_cost
from benchmarks.support.result import Result, figure, quantile
from rig.kinds.wavebot.tick import KIND
from rig.realtime import cycle

MAX_MEAN_US = 20.0
MAX_SHARE_OF_PERIOD = 0.2  # that the 99.9th percentile may take

_NO_TIMING = cycle.Timing(0.0, 0.0, 0)


def mean_cycle_cost(recorded: RecordedTicks) -> float:
    """Mean microseconds of a cycle over the recorded ticks, in processor time."""
    step = cycle.make(KIND)
    params, state, dt, timing = recorded.params, recorded.state, recorded.dt, _NO_TIMING
    began = process_time_ns()
    for tick, sense in enumerate(recorded.senses, recorded.first):
        state, _, _ = step(params, state, sense, 0, tick, timing, 1, dt)
    return (process_time_ns() - began) / 1e3 / len(recorded.senses)


def cycle_costs(recorded: RecordedTicks) -> list[float]:
    """Microseconds of each single cycle, with the two looks at the clock taken off."""
    step = cycle.make(KIND)
    params, state, dt, timing = recorded.params, recorded.state, recorded.dt, _NO_TIMING
    stamps = array("q", bytes(8 * len(recorded.senses)))
    now = perf_counter_ns
    for i, sense in enumerate(recorded.senses):
        began = now()
        state, _, _ = step(params, state, sense, 0, recorded.first + i, timing, 1, dt)
        stamps[i] = now() - began
    look = min(-(now() - now()) for _ in range(1000))  # what two looks at the clock cost
    return [(stamp - look) / 1e3 for stamp in stamps]


def is_reproducible(recorded: RecordedTicks) -> bool:
    """Return True if a repetition of the recorded ticks gives the same rows to the bit."""
    step, state = cycle.make(KIND), recorded.state
    for i, (sense, row) in enumerate(zip(recorded.senses, recorded.rows, strict=True)):
        state, _, repeated = step(
            recorded.params, state, sense, 0, recorded.first + i, _NO_TIMING, 1, recorded.dt
        )
        if repeated != row:
            return False
    return True


class CycleCosts(NamedTuple):
    """Alternating blocks; all in microseconds."""

    mean: list[float]
    p50: list[float]
    p99: list[float]
    p999: list[float]
    reference: list[float]


def alternate_blocks(recorded: RecordedTicks, blocks: int) -> CycleCosts:
    """Mean, reference and single cycles, block after block."""
    found = CycleCosts([], [], [], [], [])
    with garbage_collection_off():
        for _ in range(blocks):
            found.mean.append(mean_cycle_cost(recorded))
            found.reference.append(reference_cost(max(1, len(recorded.senses) // 4)))
            single = cycle_costs(recorded)
            for into, share in ((found.p50, 0.5), (found.p99, 0.99), (found.p999, 0.999)):
                into.append(quantile(single, share))
    return found


def run_on_real_clock(campaign: Path, seconds: float) -> dict[str, Any]:
    """A loop at its real rate, timed at its seams: the cycle after a sleep, caches gone cold."""
    wait_realtime_free()
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.support.tick_process", campaign, "real", str(seconds)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise RuntimeError(done.stderr.strip().splitlines()[-1])
    report: dict[str, Any] = json.loads(done.stdout)
    return report


def measure(short: bool) -> Result:
    """Cycle cost, in blocks alternating with a fixed reference, and in a loop at its real rate."""
    ticks, blocks, seconds, loops = (2000, 4, 2.0, 1) if short else (10_000, 20, 10.0, 3)
    with tempfile.TemporaryDirectory() as scratch:
        path = write_campaign_file(Path(scratch), 60.0)
        recorded = record_ticks(path, ticks)
        if not is_reproducible(recorded):
            raise RuntimeError("the cycle does not repeat its own rows")
        found = alternate_blocks(recorded, blocks)
        real = [run_on_real_clock(path, seconds) for _ in range(loops)]
    period = recorded.dt * 1e6
    bound = MAX_SHARE_OF_PERIOD * period
    refused = sorted({why for one in real for why in one["refused"]})
    return Result(
        "cycle",
        f"one pure cycle of a WaveBot in plain Python, of a period of {period:g} us",
        f"{blocks} blocks of {ticks} cycles and of {ticks // 4} references, alternating; "
        f"{loops} x {seconds:g} s on the real clock",
        (
            *raw_and_normalised("mean", found.mean, found.reference, MAX_MEAN_US),
            figure("p50", "us", found.p50),
            figure("p99", "us", found.p99),
            figure("p99.9", "us", found.p999, at_most=bound),
            figure("100 NamedTuples (reference)", "us of processor", found.reference),
            *(
                figure(
                    f"{name}, in a loop at its real rate",
                    "us",
                    [one["us"]["cycle"][key] for one in real],
                    at_most=limit,
                )
                for name, key, limit in (
                    ("mean", "mean", None),
                    ("p50", "p50", None),
                    ("p99", "p99", None),
                    ("p99.9", "p99.9", bound),
                )
            ),
        ),
        (
            "block means are processor time; percentiles are by the clock, so what the host does "
            "with the core in between is in them",
            *(f"on the real clock not granted: {why}" for why in refused),
        ),
    )
