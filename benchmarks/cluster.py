"""Sweeps on a Dask cluster on loopback: two workers compared with one, and the overhead."""

import contextlib
import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import NamedTuple

from benchmarks.batch import IRREGULAR, write_campaign_file
from benchmarks.support.recorded import ROOT
from benchmarks.support.result import Result, figure
from rig.sweeps import cluster, sweep
from rig.sweeps.campaigns import LEAD_IN
from rig.sweeps.cases import Outcome

MIN_SPEEDUP, MAX_OVERHEAD = 1.6, 10.0  # times, %


class SweepTime(NamedTuple):
    """Time of one sweep on a cluster."""

    seconds: float  # from the first submitted case to the last outcome
    busy: float  # s of the workers in cases
    cases: int


@contextlib.contextmanager
def dask_node(role: str, *arguments: str) -> Iterator[str]:
    """Start a Dask scheduler or worker in its own process; give its address."""
    command = [sys.executable, "-W", "ignore", "-m", f"distributed.cli.dask_{role}", *arguments]
    env = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    with subprocess.Popen(
        [*command, "--host", "127.0.0.1", "--no-dashboard"],
        cwd=ROOT, env=env, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        try:
            assert process.stderr is not None
            for line in process.stderr:
                if address := re.search(r"(?:Scheduler|worker) at: *(tcp://\S+)", line):
                    # The pipe must be read: it is full after an hour, and the node would block.
                    Thread(target=process.stderr.read, daemon=True).start()
                    yield address[1]
                    break
        finally:
            process.terminate()


def dask_worker(scheduler: str) -> contextlib.AbstractContextManager[str]:
    """Start a worker of one thread."""
    return dask_node("worker", scheduler, "--nthreads", "1", "--no-nanny")


def run_sweep(path: Path, folder: Path, scheduler: str) -> SweepTime:
    """Time all rows of a campaign on the scheduler's workers; write only the journal."""
    opened = sweep.open_sweep(path, [], folder, sequential=False, lead_in=LEAD_IN)
    busy: list[float] = []
    outcomes: list[Outcome] = []
    executor = cluster.cluster_executor(
        scheduler, opened.cases.request, opened.digest, lambda done: busy.append(done.seconds)
    )
    began = time.perf_counter()
    for outcome in executor(opened.cases, opened.cases.run):
        outcomes.append(outcome)
    seconds = time.perf_counter() - began
    if len(outcomes) != len(opened.cases) or any(each.failed for each in outcomes):
        raise RuntimeError(
            f"{len(outcomes)} of {len(opened.cases)} cases, not all of them complete"
        )
    return SweepTime(seconds, sum(busy), len(outcomes))


def measure(short: bool) -> Result:
    """Time one worker and two, alternating, on a campaign that all workers have compiled."""
    repeats, seconds, last = (1, 20, -1100) if short else (5, 300, -2000)
    single_times: list[SweepTime] = []
    pair_times: list[SweepTime] = []
    with tempfile.TemporaryDirectory() as scratch, contextlib.ExitStack() as nodes:
        folder = Path(scratch)
        (folder / "few").mkdir()
        warm_up = write_campaign_file(folder / "few", IRREGULAR.format(seconds=20, last=-1100))
        path = write_campaign_file(folder, IRREGULAR.format(seconds=seconds, last=last))
        single = nodes.enter_context(dask_node("scheduler", "--port", "0"))
        pair = nodes.enter_context(dask_node("scheduler", "--port", "0"))
        for scheduler in (single, pair, pair):
            nodes.enter_context(dask_worker(scheduler))
        for scheduler in (single, pair):
            run_sweep(warm_up, folder / "first", scheduler)
        for _ in range(repeats):
            single_times.append(run_sweep(path, folder / "one", single))
            pair_times.append(run_sweep(path, folder / "two", pair))
    gains = [a.seconds / b.seconds for a, b in zip(single_times, pair_times, strict=True)]
    lost = [100.0 * (1.0 - each.busy / each.seconds) for each in single_times]
    lost_of_two = [100.0 * (1.0 - each.busy / (2.0 * each.seconds)) for each in pair_times]
    return Result(
        "cluster",
        "sweeps on a Dask cluster: scheduler, client and workers of one thread on this host",
        f"{repeats} times {single_times[0].cases} rows of {seconds} s on one worker and on two, "
        "alternating",
        (
            figure("one worker", "s", [each.seconds for each in single_times]),
            figure("two workers", "s", [each.seconds for each in pair_times]),
            figure("two against one", "x", gains, at_least=None if short else MIN_SPEEDUP),
            figure("not in cases, one worker", "%", lost, at_most=None if short else MAX_OVERHEAD),
            figure("not in cases, two workers", "%", lost_of_two),
        ),
        (f"load of the host before: {os.getloadavg()[0]:.1f}",),
    )
