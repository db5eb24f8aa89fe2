"""Cost of one pure cycle: estimate, law, safety, limits and the row, no plant and no ring."""

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
MAX_SHARE_OF_PERIOD = 0.2  # limit of the 99.9th percentile

_NO_TIMING = cycle.Timing(0.0, 0.0, 0)


def mean_cycle_cost(recorded: RecordedTicks) -> float:
    """Return the mean processor time (us) of a cycle over the recorded ticks."""
    step = cycle.make(KIND)
    params, state, dt, timing = recorded.params, recorded.state, recorded.dt, _NO_TIMING
    began = process_time_ns()
    for tick, sense in enumerate(recorded.senses, recorded.first):
        state, _, _ = step(params, state, sense, 0, tick, timing, 1, dt)
    return (process_time_ns() - began) / 1e3 / len(recorded.senses)


def cycle_costs(recorded: RecordedTicks) -> list[float]:
    """Return the time (us) of each cycle, less the cost of reading the clock twice."""
    step = cycle.make(KIND)
    params, state, dt, timing = recorded.params, recorded.state, recorded.dt, _NO_TIMING
    stamps = array("q", bytes(8 * len(recorded.senses)))
    now = perf_counter_ns
    for i, sense in enumerate(recorded.senses):
        began = now()
        state, _, _ = step(params, state, sense, 0, recorded.first + i, timing, 1, dt)
        stamps[i] = now() - began
    clock_cost = min(-(now() - now()) for _ in range(1000))  # of two readings
    return [(stamp - clock_cost) / 1e3 for stamp in stamps]


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
    """Costs of alternating blocks, in microseconds."""

    mean: list[float]
    p50: list[float]
    p99: list[float]
    p999: list[float]
    reference: list[float]


def alternate_blocks(recorded: RecordedTicks, blocks: int) -> CycleCosts:
    """Measure mean, reference and single cycles, block after block."""
    costs = CycleCosts([], [], [], [], [])
    with garbage_collection_off():
        for _ in range(blocks):
            costs.mean.append(mean_cycle_cost(recorded))
            costs.reference.append(reference_cost(max(1, len(recorded.senses) // 4)))
            single = cycle_costs(recorded)
            for values, share in ((costs.p50, 0.5), (costs.p99, 0.99), (costs.p999, 0.999)):
                values.append(quantile(single, share))
    return costs


def run_on_real_clock(campaign: Path, seconds: float) -> dict[str, Any]:
    """Time the parts of a loop at its real rate: the cycle follows a sleep, with cold caches."""
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
        costs = alternate_blocks(recorded, blocks)
        real = [run_on_real_clock(path, seconds) for _ in range(loops)]
    period = recorded.dt * 1e6
    limit_us = MAX_SHARE_OF_PERIOD * period
    refused = sorted({why for one in real for why in one["refused"]})
    return Result(
        "cycle",
        f"one pure cycle of a WaveBot in plain Python, of a period of {period:g} us",
        f"{blocks} blocks of {ticks} cycles and of {ticks // 4} references, alternating; "
        f"{loops} x {seconds:g} s on the real clock",
        (
            *raw_and_normalised("mean", costs.mean, costs.reference, MAX_MEAN_US),
            figure("p50", "us", costs.p50),
            figure("p99", "us", costs.p99),
            figure("p99.9", "us", costs.p999, at_most=limit_us),
            figure("100 NamedTuples (reference)", "us of processor", costs.reference),
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
                    ("p99.9", "p99.9", limit_us),
                )
            ),
        ),
        (
            "block means are processor time; percentiles are wall time, so they include "
            "interruptions by the host",
            *(f"on the real clock not granted: {why}" for why in refused),
        ),
    )
