"""Wake-up lateness of the real-time loop, compared with cyclictest at equal priority and core."""

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from benchmarks.ring import refused_privileges
from benchmarks.support.live_run import TickObservation, live_run
from benchmarks.support.recorded import write_campaign_file
from benchmarks.support.result import Figure, Result, figure, quantile, ratios
from rig.realtime.scheduling import PRIORITY
from rig.recording.runs import open_run

MAX_P50_RATIO, MAX_P99_RATIO = 2.0, 3.0
RATE_HZ = 1000
BINS = 100_000  # us of cyclictest's histogram
NO_CYCLICTEST = (
    "no comparison: cyclictest is not here (Debian, Ubuntu: apt-get install rt-tests; "
    "it needs root for SCHED_FIFO)"
)


class LatenessBlock(NamedTuple):
    """Lateness over one block, in microseconds."""

    p50: float
    p99: float
    worst: float
    wakes: int


class LoopBlock(NamedTuple):
    """One block of the real-time loop, with its counts of periods."""

    lateness: LatenessBlock
    work: tuple[float, float, float]  # us of a tick: p50, p99, p99.9
    skipped: int  # periods lost
    imbalance: int  # executed + skipped - elapsed periods, by the loop's own count
    drift: float  # periods, the same by the monotonic clock of an observer
    refused: tuple[str, ...]


def last_core() -> int:
    """Return the core to which the loop pins itself."""
    return max(os.sched_getaffinity(0))


def summarise(late: npt.NDArray[np.int64]) -> LatenessBlock:
    """Return the percentiles of latenesses in whole microseconds."""
    return LatenessBlock(quantile(late, 0.5), quantile(late, 0.99), float(late.max()), len(late))


def parse_histogram(text: str) -> LatenessBlock:
    """Return the percentiles of the output of ``cyclictest -h``; ValueError without a histogram."""
    pairs = [line.split() for line in text.splitlines() if re.fullmatch(r"\d+\s+\d+", line)]
    counts = np.array([(int(us), int(count)) for us, count in pairs], dtype=np.int64)
    worst = re.search(r"# Max Latencies: (\d+)", text)
    beyond = re.search(r"# Histogram Overflows: (\d+)", text)
    if len(counts) == 0 or counts[:, 1].sum() == 0 or worst is None or beyond is None:
        raise ValueError(f"no histogram in the output of cyclictest: {text.strip()[-200:]}")
    top = int(worst[1])
    late = np.concatenate(
        (np.repeat(counts[:, 0], counts[:, 1]), np.full(int(beyond[1]), top, dtype=np.int64))
    )
    return summarise(late)


def run_cyclictest(seconds: float, rate_hz: int = RATE_HZ) -> LatenessBlock:
    """Run cyclictest: FIFO, absolute clock_nanosleep, memory locked, on the loop's core."""
    interval_us = round(1e6 / rate_hz)
    command = [
        "cyclictest",
        *("--quiet", "--mlockall", "--policy=fifo", f"--priority={PRIORITY}", "--threads=1"),
        *(f"--affinity={last_core()}", f"--interval={interval_us}", f"--histogram={BINS}"),
        f"--loops={round(seconds * rate_hz)}",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"cyclictest: {(done.stderr or done.stdout).strip()[-200:]}")
    return parse_histogram(done.stdout)


def run_loop_block(campaign: Path, runs: Path, seconds: float, rate_hz: int = RATE_HZ) -> LoopBlock:
    """Run the loop under the supervisor; the block begins with its first tick."""
    observations: list[TickObservation] = []
    with live_run(campaign, runs, real_clock=True) as run:
        start = run.wait_started()
        while time.monotonic() < start.time + seconds + 0.1:
            observations.append(run.observe_tick())
            time.sleep(0.01)
        run.stop()
        outcome = run.wait_ended()
    if outcome["status"] != "stopped":
        raise RuntimeError(f"the loop ended before its block: {outcome['reason']}")
    return loop_timing(run.folder, seconds, tick_drift(observations, rate_hz), rate_hz)


def loop_timing(folder: Path, seconds: float, drifted: float, rate_hz: int = RATE_HZ) -> LoopBlock:
    """Return the timing of the first ``seconds`` of a run from its rows."""
    periods = round(seconds * rate_hz)
    data = open_run(folder, fields=["tick", "timing"])
    ticks, skipped = data["tick"].values, data["timing.skipped"].values
    within = ticks < periods
    late = (data["timing.lateness"].values[within] * 1e6).astype(np.int64)
    work = data["timing.work"].values[1:][within[1:]] * 1e6  # a row has the work of the tick before
    return LoopBlock(
        summarise(late),
        (quantile(work, 0.5), quantile(work, 0.99), quantile(work, 0.999)),
        int(skipped[within][-1]),
        len(ticks) + int(skipped[-1]) - (int(ticks[-1]) + 1),
        drifted,
        refused_privileges(folder),
    )


def tick_drift(observations: list[TickObservation], rate_hz: int = RATE_HZ) -> float:
    """Return the drift (periods) of the loop's tick against the monotonic clock.

    An observation is up to one period later than its tick, and later still if the host stalls. The
    earliest observations of the first and of the last quarter have neither error.
    """
    ahead = [each.tick - (each.time - observations[0].time) * rate_hz for each in observations]
    quarter = max(1, len(ahead) // 4)
    return max(ahead[-quarter:]) - max(ahead[:quarter])


class AlternatingBlocks(NamedTuple):
    """Alternating blocks under one load; without cyclictest its list is empty."""

    loop: list[LoopBlock]
    cyclictest: list[LatenessBlock]


def alternate_blocks(
    folder: Path,
    seconds: float,
    pairs: int,
    *,
    busy: bool,
    has_cyclictest: bool,
    rate_hz: int = RATE_HZ,
) -> AlternatingBlocks:
    """Alternate blocks of loop and cyclictest; ``busy``: while a process keeps a core busy."""
    campaign = write_campaign_file(folder, seconds + 60.0, rate_hz)
    blocks = AlternatingBlocks([], [])
    load: AbstractContextManager[object] = _BusyProcess() if busy else nullcontext()
    with load:
        for i in range(pairs):
            runs = folder / f"{'busy' if busy else 'calm'}{i}"
            blocks.loop.append(run_loop_block(campaign, runs, seconds, rate_hz))
            shutil.rmtree(runs)
            if has_cyclictest:
                blocks.cyclictest.append(run_cyclictest(seconds, rate_hz))
    return blocks


class _BusyProcess:
    """A process that computes without end on the first core."""

    def __enter__(self) -> None:
        code = (
            f"import os; os.sched_setaffinity(0, {{{min(os.sched_getaffinity(0))}}})\n"
            "while True: sum(range(1000))"
        )
        self._process = subprocess.Popen([sys.executable, "-c", code])

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()


def timing_figures(load: str, blocks: AlternatingBlocks) -> list[Figure]:
    """Return the figures of alternating blocks, whose names begin with ``load``."""
    loop, cyclictest = blocks.loop, blocks.cyclictest
    figures: list[Figure] = []
    for name, loop_us, cyclictest_us, limit in (
        ("p50", [b.lateness.p50 for b in loop], [b.p50 for b in cyclictest], MAX_P50_RATIO),
        ("p99", [b.lateness.p99 for b in loop], [b.p99 for b in cyclictest], MAX_P99_RATIO),
        ("worst", [b.lateness.worst for b in loop], [b.worst for b in cyclictest], None),
    ):
        figures.append(figure(f"{load}: loop, {name}", "us late", loop_us))
        if cyclictest:
            figures.append(figure(f"{load}: cyclictest, {name}", "us late", cyclictest_us))
            if all(cyclictest_us):
                compared = ratios(loop_us, cyclictest_us)
                label = f"{load}: loop / cyclictest, {name}"
                figures.append(figure(label, "ratio", compared, at_most=limit))
    for i, name in enumerate(("p50", "p99", "p99.9")):
        figures.append(figure(f"{load}: tick with plant, {name}", "us", [b.work[i] for b in loop]))
    figures += [
        figure(f"{load}: periods skipped and counted", "periods", [b.skipped for b in loop]),
        figure(
            f"{load}: executed + skipped - elapsed, own count",
            "periods",
            [abs(b.imbalance) for b in loop],
            at_most=0,
            criterion="worst",
        ),
        figure(
            f"{load}: the same by the clock, from outside",
            "periods",
            [abs(b.drift) for b in loop],
            at_most=1,
            criterion="worst",
        ),
    ]
    return figures


def measure(short: bool) -> Result:
    """Alternating blocks on an otherwise idle machine, then with the other core kept busy."""
    seconds, pairs = (2.0, 1) if short else (20.0, 5)
    has_cyclictest = shutil.which("cyclictest") is not None
    loads = [("calm", False)]
    notes = [
        "calm: no process started except the loop with its supervisor and logger, or cyclictest",
        "busy: a process computing without end on the first core, in loop and cyclictest blocks",
    ]
    if not has_cyclictest:
        notes.append(NO_CYCLICTEST)
    if len(os.sched_getaffinity(0)) > 1:
        loads.append(("busy", True))
    else:
        notes.append("no busy blocks: this host has one core")
    figures: list[Figure] = []
    refused: set[str] = set()
    with tempfile.TemporaryDirectory() as scratch:
        for name, busy in loads:
            blocks = alternate_blocks(
                Path(scratch), seconds, pairs, busy=busy, has_cyclictest=has_cyclictest
            )
            figures += timing_figures(name, blocks)
            refused.update(reason for block in blocks.loop for reason in block.refused)
    notes += [
        f"not granted to the loop, so not the same terms: {reason}" for reason in sorted(refused)
    ]
    return Result(
        "lateness",
        f"wake-up of the real-time loop at {RATE_HZ} Hz, FIFO {PRIORITY}, last core",
        f"{2 * pairs if has_cyclictest else pairs} blocks of {seconds:g} s under each load"
        + (", loop and cyclictest alternating" if has_cyclictest else ""),
        tuple(figures),
        tuple(notes),
    )
