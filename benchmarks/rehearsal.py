"""Speed of whole rehearsals with their log, and the wall time of `rig run`."""

import os
import subprocess
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

from benchmarks.start import rig_command
from benchmarks.support.live_run import LOGGER, LOOP, live_run, processor_time
from benchmarks.support.recorded import ROOT, build_loop_parts, write_campaign_file
from benchmarks.support.result import Result, figure, ratios

MAX_DEFAULT_S = 12.0
MIN_DEFAULT_RATIO = 6.0  # of `rig run` with an interpreted loop to that without
MIN_RATIO, MIN_TIMES_REAL = 15.0, 200.0  # of a rehearsal to an interpreted one; of one core
DEFAULT = ROOT / "configs" / "campaigns" / "default.yaml"


class RehearsalSpeed(NamedTuple):
    """Speed of one rehearsal, from its first tick until its last row is saved on disk."""

    times_real: float  # simulated seconds per second
    times_core: float  # simulated seconds per second of processor time, loop and logger together
    loop_us: float  # processor time of the loop per tick
    logger_us: float  # processor time of the logger per row


def measure_speed(
    campaign: Path, runs: Path, dt: float, core: int | None, *, interpreted: bool = False
) -> RehearsalSpeed:
    """Rehearse a campaign under the real supervisor, on one core or on any (None)."""
    with live_run(campaign, runs, real_clock=False, interpreted=interpreted, core=core) as run:
        logger, loop = run.pid(LOGGER), run.pid(LOOP)
        run.wait_started()
        first, began = run.ring.head, time.monotonic()
        start = {pid: processor_time(pid) or 0.0 for pid in (loop, logger)}
        processor_s = dict(start)
        while not run.is_drained():
            processor_s = {
                # A thread that has ended no longer counts.
                pid: max(processor_time(pid) or 0.0, before)
                for pid, before in processor_s.items()
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
    )


def time_run(task: Path, runs: Path, *options: str) -> float:
    """Return the wall time (s) of `rig run` of a task, products and pictures included."""
    began = time.monotonic()
    command = [*rig_command(), "run", str(task), "--runs", str(runs), "--json", *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"rig run ended with {done.returncode}: {done.stderr}{done.stdout}")
    return time.monotonic() - began


def measure(short: bool) -> Result:
    """Alternate rehearsals, compiled and interpreted, then time `rig run` of a whole campaign."""
    seconds, interpreted_s, repetitions = (100.0, 30.0, 1) if short else (3000.0, 300.0, 5)
    task = ROOT / "configs" / "campaigns" / "quick.yaml" if short else DEFAULT
    cores = sorted(os.sched_getaffinity(0))
    one_core, all_cores, slow = (list[RehearsalSpeed]() for _ in range(3))
    subprocess.run(
        [*rig_command(), "compile", str(task)], cwd=ROOT, check=True, capture_output=True
    )
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        campaign = write_campaign_file(folder, seconds)
        shorter = write_campaign_file(folder, interpreted_s)
        plan = build_loop_parts(campaign).plan
        dt = plan.dt
        # This process polls every 10 ms; it stays off the measured core.
        others = set(cores[:-1]) or set(cores)
        try:
            for i in range(repetitions):
                os.sched_setaffinity(0, others)
                one_core.append(measure_speed(campaign, folder / f"one{i}", dt, cores[-1]))
                slow.append(
                    measure_speed(shorter, folder / f"slow{i}", dt, cores[-1], interpreted=True)
                )
                os.sched_setaffinity(0, set(cores))
                all_cores.append(measure_speed(campaign, folder / f"two{i}", dt, None))
        finally:
            os.sched_setaffinity(0, set(cores))
        whole = [time_run(task, folder / f"whole{i}") for i in range(repetitions)]
        whole_slow = time_run(task, folder / "whole_slow", "--interpreted")
        whole.append(time_run(task, folder / "whole"))
    return Result(
        "rehearsal",
        "full rehearsal with plant and log, first tick to last row on disk; `rig run` as a whole",
        f"{repetitions} rehearsals of {plan.duration:g} s on one core, interpreted ones of "
        f"{interpreted_s:g} s and ones on {len(cores)} cores, alternating; {len(whole)} x "
        f"`rig run` of {task.stem}, compiled before, and an interpreted one before the last",
        (
            figure(
                f"rig run of {task.stem}, products and pictures included", "s", whole,
                at_most=None if short else MAX_DEFAULT_S,
            ),
            figure(f"rig run of {task.stem}, interpreted", "s", whole_slow),
            figure(
                "ratio of these two", "x", [whole_slow / each for each in whole],
                at_least=None if short else MIN_DEFAULT_RATIO,
            ),
            figure(
                "one core, loop and logger and all",
                "x real time",
                [each.times_real for each in one_core],
                at_least=None if short else MIN_TIMES_REAL,
            ),
            figure(
                "one core, by processor time", "x real time", [each.times_core for each in one_core]
            ),
            figure(
                "one core, interpreted, by processor time",
                "x real time",
                [each.times_core for each in slow],
            ),
            figure(
                "ratio of these two, log included", "x",
                ratios([e.times_core for e in one_core], [e.times_core for e in slow]),
                at_least=None if short else MIN_RATIO,
            ),
            figure(
                f"{len(cores)} cores, as started", "x real time", [e.times_real for e in all_cores]
            ),
            figure("loop", "us of processor a tick", [each.loop_us for each in one_core]),
            figure("logger", "us of processor a row", [each.logger_us for each in one_core]),
        ),
        () if len(cores) > 1 else ("this host has one core: both figures are of the same kind",),
    )  # fmt: skip
