"""How many times faster than real time a full rehearsal runs, and where its time goes."""

import os
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.support.live_run import LOGGER, LOOP, live_run, processor_time
from benchmarks.support.recorded import Parts, campaign_file, parts, quiet
from benchmarks.support.reference_cpu import NORMALISED, REFERENCE_CPU_US, reference_cost
from benchmarks.support.result import Figure, Result, figure
from benchmarks.support.tick_process import tick
from benchmarks.support.tick_timing import PARTS, Stamps
from rig.realtime.clock import VirtualClock

TIMES_REAL = 30.0
PACE = 5000  # repetitions of the reference
INTERRUPTED = 5.0  # times the median: a tick in which the host took the core away


class Speed(NamedTuple):
    """One rehearsal, from its first tick until its last row was safe on disk."""

    times_real: float  # simulated seconds a second
    times_core: float  # simulated seconds a second of processor time, loop and logger together
    loop_us: float  # processor time of the loop a tick
    logger_us: float  # processor time of the logger a row
    reference_us: float  # the host's pace on that core, before and after


def speed(campaign: Path, runs: Path, dt: float, core: int | None) -> Speed:
    """Rehearse a campaign under the real supervisor; on one core, or wherever the host likes."""
    before = _pace(core)
    with live_run(campaign, runs, real_clock=False, core=core) as run:
        logger, loop = run.pid(LOGGER), run.pid(LOOP)
        run.wait_started()
        first, began = run.ring.head, time.monotonic()
        start = {pid: processor_time(pid) or 0.0 for pid in (loop, logger)}
        spent = dict(start)
        while not run.drained():
            spent = {pid: processor_time(pid) or before for pid, before in spent.items()}
            time.sleep(0.01)
        took, ticks = time.monotonic() - began, run.ring.head - first
        outcome = run.wait_ended()
    if outcome["status"] != "complete" or outcome["logger_restarts"]:
        raise RuntimeError(f"the rehearsal did not end well: {outcome}")
    used = {pid: spent[pid] - start[pid] for pid in spent}
    return Speed(
        ticks * dt / took,
        ticks * dt / sum(used.values()),
        used[loop] / ticks * 1e6,
        used[logger] / ticks * 1e6,
        (before + _pace(core)) / 2.0,
    )


def _pace(core: int | None) -> float:
    """The reference's cost on a core, this process being there for a moment."""
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, allowed if core is None else {core})
    try:
        return reference_cost(PACE)
    finally:
        os.sched_setaffinity(0, allowed)


class Tick(NamedTuple):
    """Mean microseconds of a tick in one process, without a logger."""

    plain: float  # of processor time, nothing measured inside
    parts: tuple[float, ...]  # as in PARTS, with the stamps


def breakdown(made: Parts, seconds: float) -> Tick:
    """A loop not timed inside, then one timed at its seams."""
    stamps = Stamps()
    with quiet():
        began = time.process_time()
        ticks, _ = tick(made, VirtualClock, seconds, None)
        spent = time.process_time() - began
        tick(made, VirtualClock, seconds, stamps)
    found = np.array(stamps.parts())
    whole = found.sum(axis=0)
    kept = whole < INTERRUPTED * np.median(whole)
    return Tick(spent / ticks * 1e6, tuple(found[:, kept].mean(axis=1).tolist()))


def _shares(ticks: list[Tick]) -> list[Figure]:
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
    one, two = list[Speed](), list[Speed]()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        campaign = campaign_file(folder, seconds)
        made = parts(campaign)
        dt = made.plan.dt
        # This process looks every 10 ms; it stays off the core that is measured.
        if len(cores) > 1:
            os.sched_setaffinity(0, set(cores[:-1]))
        try:
            for i in range(repetitions):
                one.append(speed(campaign, folder / f"one{i}", dt, cores[-1]))
                os.sched_setaffinity(0, set(cores))
                two.append(speed(campaign, folder / f"two{i}", dt, None))
                if len(cores) > 1:
                    os.sched_setaffinity(0, set(cores[:-1]))
        finally:
            os.sched_setaffinity(0, set(cores))
        ticks = [breakdown(made, inside) for _ in range(blocks)]
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
                at_least=TIMES_REAL,
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
            *_shares(ticks),
        ),
        () if len(cores) > 1 else ("this host has one core: both figures are of the same kind",),
    )
