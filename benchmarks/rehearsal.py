"""How many times faster than real time a full rehearsal runs, and where its time goes."""

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
INTERRUPTED_FACTOR = 5.0  # times the median: a tick in which the host took the core away


class RehearsalSpeed(NamedTuple):
    """One rehearsal, from its first tick until its last row was safe on disk."""

    times_real: float  # simulated seconds a second
    times_core: float  # simulated seconds a second of processor time, loop and logger together
    loop_us: float  # processor time of the loop a tick
    logger_us: float  # processor time of the logger a row
    reference_us: float  # the host's pace on that core, before and after


def measure_speed(campaign: Path, runs: Path, dt: float, core: int | None) -> RehearsalSpeed:
    """Rehearse a campaign under the real supervisor; on one core, or wherever the host likes."""
    before = _reference_cost_on(core)
    with live_run(campaign, runs, real_clock=False, core=core) as run:
        logger, loop = run.pid(LOGGER), run.pid(LOOP)
        run.wait_started()
        first, began = run.ring.head, time.monotonic()
        start = {pid: processor_time(pid) or 0.0 for pid in (loop, logger)}
        spent = dict(start)
        while not run.is_drained():
            spent = {pid: processor_time(pid) or before for pid, before in spent.items()}
            time.sleep(0.01)
        took, ticks = time.monotonic() - began, run.ring.head - first
        outcome = run.wait_ended()
    if outcome["status"] != "complete" or outcome["logger_restarts"]:
        raise RuntimeError(f"the rehearsal did not end well: {outcome}")
    used = {pid: spent[pid] - start[pid] for pid in spent}
    return RehearsalSpeed(
        ticks * dt / took,
        ticks * dt / sum(used.values()),
        used[loop] / ticks * 1e6,
        used[logger] / ticks * 1e6,
        (before + _reference_cost_on(core)) / 2.0,
    )


def _reference_cost_on(core: int | None) -> float:
    """The reference's cost on a core, this process being there for a moment."""
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, allowed if core is None else {core})
    try:
        return reference_cost(REFERENCE_REPEATS)
    finally:
        os.sched_setaffinity(0, allowed)


class TickCost(NamedTuple):
    """Mean microseconds of a tick in one process, without a logger."""

    plain: float  # of processor time, nothing measured inside
    parts: tuple[float, ...]  # as in PARTS, with the stamps


def split_tick(made: LoopParts, seconds: float) -> TickCost:
    """A loop not timed inside, then one timed at its seams."""
    stamps = Stamps()
    with garbage_collection_off():
        began = time.process_time()
        ticks, _ = run_loop(made, VirtualClock, seconds, None)
        spent = time.process_time() - began
        run_loop(made, VirtualClock, seconds, stamps)
    found = np.array(stamps.tick_times())
    whole = found.sum(axis=0)
    kept = whole < INTERRUPTED_FACTOR * np.median(whole)
    return TickCost(spent / ticks * 1e6, tuple(found[:, kept].mean(axis=1).tolist()))


def _tick_figures(ticks: list[TickCost]) -> list[Figure]:
    figures = [figure("tick without logger", "us of processor", [one.plain for one in ticks])]
    names = {
        "plant": "plant and its devices",
        "cycle": "cycle",
        "ring": "row into the ring",
        "rest": "rest (loop, clock, mailbox)",
    }
    for i, part in enumerate(PARTS):
        shares = [100.0 * one.parts[i] / sum(one.parts) for one in ticks]
        figures.append(figure(f"  share of {names[part]}", "%", shares))
    added = [sum(one.parts) - one.plain for one in ticks]
    figures.append(figure("  stamps, in these shares", "us", added))
    return figures


def measure(short: bool) -> Result:
    """Rehearsals on one core and on two, alternating; then one tick taken apart."""
    seconds, repetitions = (18.0, 1) if short else (150.0, 5)
    inside, blocks = (5.0, 1) if short else (40.0, 5)
    cores = sorted(os.sched_getaffinity(0))
    one, two = list[RehearsalSpeed](), list[RehearsalSpeed]()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        campaign = write_campaign_file(folder, seconds)
        made = build_loop_parts(campaign)
        dt = made.plan.dt
        # This process looks every 10 ms; it stays off the core that is measured.
        if len(cores) > 1:
            os.sched_setaffinity(0, set(cores[:-1]))
        try:
            for i in range(repetitions):
                one.append(measure_speed(campaign, folder / f"one{i}", dt, cores[-1]))
                os.sched_setaffinity(0, set(cores))
                two.append(measure_speed(campaign, folder / f"two{i}", dt, None))
                if len(cores) > 1:
                    os.sched_setaffinity(0, set(cores[:-1]))
        finally:
            os.sched_setaffinity(0, set(cores))
        ticks = [split_tick(made, inside) for _ in range(blocks)]
    return Result(
        "rehearsal",
        "full rehearsal with plant and log, first tick to last row on disk",
        f"{repetitions} rehearsals of {made.plan.duration:g} s on one core and {repetitions} on "
        f"{len(cores)}, alternating; {blocks} x {inside:g} s taken apart",
        (
            figure(
                "one core, loop and logger and all",
                "x real time",
                [each.times_real for each in one],
            ),
            figure(
                f"one core, {NORMALISED}",
                "x real time",
                [each.times_real * each.reference_us / REFERENCE_CPU_US for each in one],
                at_least=MIN_TIMES_REAL,
            ),
            figure(
                "100 NamedTuples (reference)",
                "us of processor",
                [each.reference_us for each in one],
            ),
            figure("one core, by processor time", "x real time", [each.times_core for each in one]),
            figure(f"{len(cores)} cores, as started", "x real time", [e.times_real for e in two]),
            figure("loop", "us of processor a tick", [each.loop_us for each in one]),
            figure("logger", "us of processor a row", [each.logger_us for each in one]),
            *_tick_figures(ticks),
        ),
        () if len(cores) > 1 else ("this host has one core: both figures are of the same kind",),
    )
