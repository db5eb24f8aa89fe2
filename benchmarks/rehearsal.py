"""Speed of a full rehearsal in times real time, and the cost of its parts."""

import os
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.support.live_run import LOGGER, LOOP, live_run, processor_time
from benchmarks.support.recorded import (
    LoopParts,
    build_loop_parts,
    garbage_collection_off,
    write_campaign_file,
)
from benchmarks.support.reference_cpu import NORMALISED, REFERENCE_CPU_US, reference_cost
from benchmarks.support.result import Figure, Result, figure
from benchmarks.support.tick_process import run_loop
from benchmarks.support.tick_timing import PARTS, Stamps
from rig.realtime.clock import VirtualClock

MIN_TIMES_REAL = 30.0
REFERENCE_REPEATS = 5000  # repetitions of the reference
INTERRUPTED_FACTOR = 5.0  # times the median: a tick that the host has interrupted


class RehearsalSpeed(NamedTuple):
    """Speed of one rehearsal, from its first tick until its last row is saved on disk."""

    times_real: float  # simulated seconds per second
    times_core: float  # simulated seconds per second of processor time, loop and logger together
    loop_us: float  # processor time of the loop per tick
    logger_us: float  # processor time of the logger per row
    reference_us: float  # cost of the reference on that core, mean of before and after


def measure_speed(campaign: Path, runs: Path, dt: float, core: int | None) -> RehearsalSpeed:
    """Rehearse a campaign under the real supervisor, on one core or on any (None)."""
    before = _reference_cost_on(core)
    with live_run(campaign, runs, real_clock=False, core=core) as run:
        logger, loop = run.pid(LOGGER), run.pid(LOOP)
        run.wait_started()
        first, began = run.ring.head, time.monotonic()
        start = {pid: processor_time(pid) or 0.0 for pid in (loop, logger)}
        processor_s = dict(start)
        while not run.is_drained():
            processor_s = {
                pid: processor_time(pid) or before for pid, before in processor_s.items()
            }
            time.sleep(0.01)
        took, ticks = time.monotonic() - began, run.ring.head - first
        outcome = run.wait_ended()
    if outcome["status"] != "complete" or outcome["logger_restarts"]:
        raise RuntimeError(f"the rehearsal is not complete, or its logger was restarted: {outcome}")
    used = {pid: processor_s[pid] - start[pid] for pid in processor_s}
    return RehearsalSpeed(
        ticks * dt / took,
        ticks * dt / sum(used.values()),
        used[loop] / ticks * 1e6,
        used[logger] / ticks * 1e6,
        (before + _reference_cost_on(core)) / 2.0,
    )


def _reference_cost_on(core: int | None) -> float:
    """Return the cost of the reference on a core, to which this process moves meanwhile."""
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, allowed if core is None else {core})
    try:
        return reference_cost(REFERENCE_REPEATS)
    finally:
        os.sched_setaffinity(0, allowed)


class TickCost(NamedTuple):
    """Mean microseconds of a tick in one process, without a logger."""

    plain: float  # of processor time, without time stamps
    parts: tuple[float, ...]  # as in PARTS, with time stamps


def split_tick(loop_parts: LoopParts, seconds: float) -> TickCost:
    """Time a loop without time stamps, then one with them."""
    stamps = Stamps()
    with garbage_collection_off():
        began = time.process_time()
        ticks, _ = run_loop(loop_parts, VirtualClock, seconds, None)
        processor_s = time.process_time() - began
        run_loop(loop_parts, VirtualClock, seconds, stamps)
    times = np.array(stamps.tick_times())
    totals = times.sum(axis=0)
    uninterrupted = totals < INTERRUPTED_FACTOR * np.median(totals)
    return TickCost(processor_s / ticks * 1e6, tuple(times[:, uninterrupted].mean(axis=1).tolist()))


def _tick_figures(ticks: list[TickCost]) -> list[Figure]:
    figures = [
        figure("tick without logger", "us of processor", [one_core.plain for one_core in ticks])
    ]
    names = {
        "plant": "plant and its devices",
        "cycle": "cycle",
        "ring": "row into the ring",
        "rest": "rest (loop, clock, mailbox)",
    }
    for i, part in enumerate(PARTS):
        shares = [100.0 * each.parts[i] / sum(each.parts) for each in ticks]
        figures.append(figure(f"  share of {names[part]}", "%", shares))
    added = [sum(each.parts) - each.plain for each in ticks]
    figures.append(figure("  stamps, in these shares", "us", added))
    return figures


def measure(short: bool) -> Result:
    """Alternate rehearsals on one core and on two; then split one tick into its parts."""
    seconds, repetitions = (18.0, 1) if short else (150.0, 5)
    inside, blocks = (5.0, 1) if short else (40.0, 5)
    cores = sorted(os.sched_getaffinity(0))
    one_core, all_cores = list[RehearsalSpeed](), list[RehearsalSpeed]()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        campaign = write_campaign_file(folder, seconds)
        loop_parts = build_loop_parts(campaign)
        dt = loop_parts.plan.dt
        # This process polls every 10 ms; it stays off the measured core.
        if len(cores) > 1:
            os.sched_setaffinity(0, set(cores[:-1]))
        try:
            for i in range(repetitions):
                one_core.append(measure_speed(campaign, folder / f"one{i}", dt, cores[-1]))
                os.sched_setaffinity(0, set(cores))
                all_cores.append(measure_speed(campaign, folder / f"two{i}", dt, None))
                if len(cores) > 1:
                    os.sched_setaffinity(0, set(cores[:-1]))
        finally:
            os.sched_setaffinity(0, set(cores))
        ticks = [split_tick(loop_parts, inside) for _ in range(blocks)]
    return Result(
        "rehearsal",
        "full rehearsal with plant and log, first tick to last row on disk",
        f"{repetitions} rehearsals of {loop_parts.plan.duration:g} s on one core and "
        f"{repetitions} on {len(cores)}, alternating; {blocks} x {inside:g} s split into parts",
        (
            figure(
                "one core, loop and logger and all",
                "x real time",
                [each.times_real for each in one_core],
            ),
            figure(
                f"one core, {NORMALISED}",
                "x real time",
                [each.times_real * each.reference_us / REFERENCE_CPU_US for each in one_core],
                at_least=MIN_TIMES_REAL,
            ),
            figure(
                "100 NamedTuples (reference)",
                "us of processor",
                [each.reference_us for each in one_core],
            ),
            figure(
                "one core, by processor time", "x real time", [each.times_core for each in one_core]
            ),
            figure(
                f"{len(cores)} cores, as started", "x real time", [e.times_real for e in all_cores]
            ),
            figure("loop", "us of processor a tick", [each.loop_us for each in one_core]),
            figure("logger", "us of processor a row", [each.logger_us for each in one_core]),
            *_tick_figures(ticks),
        ),
        () if len(cores) > 1 else ("this host has one core: both figures are of the same kind",),
    )
