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
INTERVAL_US = 1000
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
    """One block of the real-time loop, with its bookkeeping."""

    lateness: LatenessBlock
    work: tuple[float, float, float]  # us of a tick: p50, p99, p99.9
    skipped: int  # periods lost
    imbalance: int  # executed + skipped - elapsed periods, by the loop's own count
    drift: float  # the same by the monotonic clock seen from outside, in periods
    refused: tuple[str, ...]


def last_core() -> int:
    """The core the loop pins itself to."""
    return max(os.sched_getaffinity(0))


def summarise(late: npt.NDArray[np.int64]) -> LatenessBlock:
    """Percentiles of whole microseconds."""
    return LatenessBlock(quantile(late, 0.5), quantile(late, 0.99), float(late.max()), len(late))


def parse_histogram(text: str) -> LatenessBlock:
    """Percentiles of what ``cyclictest -h`` prints; ValueError if it is no histogram."""
    pairs = [line.split() for line in text.splitlines() if re.fullmatch(r"\d+\s+\d+", line)]
    counts = np.array([(int(us), int(count)) for us, count in pairs], dtype=np.int64)
    worst = re.search(r"# Max Latencies: (\d+)", text)
    beyond = re.search(r"# Histogram Overflows: (\d+)", text)
    if len(counts) == 0 or counts[:, 1].sum() == 0 or worst is None or beyond is None:
        raise ValueError(f"cyclictest gave no histogram: {text.strip()[-200:]}")
    top = int(worst[1])
    late = np.concatenate(
        (np.repeat(counts[:, 0], counts[:, 1]), np.full(int(beyond[1]), top, dtype=np.int64))
    )
    return summarise(late)


def run_cyclictest(seconds: float) -> LatenessBlock:
    """One block of cyclictest: FIFO, absolute clock_nanosleep, memory locked, the loop's core."""
    command = [
        "cyclictest",
        *("--quiet", "--mlockall", "--policy=fifo", f"--priority={PRIORITY}", "--threads=1"),
        *(f"--affinity={last_core()}", f"--interval={INTERVAL_US}", f"--histogram={BINS}"),
        f"--loops={round(seconds * 1e6 / INTERVAL_US)}",
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"cyclictest: {(done.stderr or done.stdout).strip()[-200:]}")
    return parse_histogram(done.stdout)


def run_loop_block(campaign: Path, runs: Path, seconds: float) -> LoopBlock:
    """One block of the loop under the supervisor, from its very first tick on."""
    peeks: list[TickObservation] = []
    with live_run(campaign, runs, real_clock=True) as run:
        start = run.wait_started()
        while time.monotonic() < start.time + seconds + 0.1:
            peeks.append(run.observe_tick())
            time.sleep(0.01)
        run.stop()
        outcome = run.wait_ended()
    if outcome["status"] != "stopped":
        raise RuntimeError(f"the loop did not last as long as its block: {outcome['reason']}")
    return loop_timing(run.folder, seconds, tick_drift(peeks))


def loop_timing(folder: Path, seconds: float, drifted: float) -> LoopBlock:
    """What the rows of a run say about its first so many seconds."""
    periods = round(seconds * 1e6 / INTERVAL_US)
    data = open_run(folder, fields=["tick", "timing"])
    ticks, skipped = data["tick"].values, data["timing.skipped"].values
    within = ticks < periods
    late = (data["timing.lateness"].values[within] * 1e6).astype(np.int64)
    work = data["timing.work"].values[1:][within[1:]] * 1e6  # each row has that of the tick before
    return LoopBlock(
        summarise(late),
        (quantile(work, 0.5), quantile(work, 0.99), quantile(work, 0.999)),
        int(skipped[within][-1]),
        len(ticks) + int(skipped[-1]) - (int(ticks[-1]) + 1),
        drifted,
        refused_privileges(folder),
    )


def tick_drift(peeks: list[TickObservation]) -> float:
    """Periods by which the loop's tick ran away from the monotonic clock.

    A look from outside comes up to a period after its tick, and later when the host stalls; the
    promptest look of each quarter of the run is free of both.
    """
    ahead = [peek.tick - (peek.time - peeks[0].time) * 1e6 / INTERVAL_US for peek in peeks]
    quarter = max(1, len(ahead) // 4)
    return max(ahead[-quarter:]) - max(ahead[:quarter])


class AlternatingBlocks(NamedTuple):
    """Alternating blocks under one load; without cyclictest its list is empty."""

    loop: list[LoopBlock]
    cyclictest: list[LatenessBlock]


def alternate_blocks(
    folder: Path, seconds: float, pairs: int, *, busy: bool, compare: bool
) -> AlternatingBlocks:
    """Loop, cyclictest, loop, cyclictest, ...; with ``busy`` during a spinning process."""
    campaign = write_campaign_file(folder, seconds + 60.0)
    found = AlternatingBlocks([], [])
    load: AbstractContextManager[object] = _BusyProcess() if busy else nullcontext()
    with load:
        for i in range(pairs):
            runs = folder / f"{'busy' if busy else 'calm'}{i}"
            found.loop.append(run_loop_block(campaign, runs, seconds))
            shutil.rmtree(runs)
            if compare:
                found.cyclictest.append(run_cyclictest(seconds))
    return found


class _BusyProcess:
    """A process that does nothing but compute, on the first core."""

    def __enter__(self) -> None:
        code = (
            f"import os; os.sched_setaffinity(0, {{{min(os.sched_getaffinity(0))}}})\n"
            "while True: sum(range(1000))"
        )
        self._process = subprocess.Popen([sys.executable, "-c", code])

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()


def _figures(load: str, found: AlternatingBlocks) -> list[Figure]:
    loop, peer = found.loop, found.cyclictest
    figures: list[Figure] = []
    for name, ours, theirs, limit in (
        ("p50", [b.lateness.p50 for b in loop], [b.p50 for b in peer], MAX_P50_RATIO),
        ("p99", [b.lateness.p99 for b in loop], [b.p99 for b in peer], MAX_P99_RATIO),
        ("worst", [b.lateness.worst for b in loop], [b.worst for b in peer], None),
    ):
        figures.append(figure(f"{load}: loop, {name}", "us late", ours))
        if peer:
            figures.append(figure(f"{load}: cyclictest, {name}", "us late", theirs))
            if all(theirs):
                compared = ratios(ours, theirs)
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
    compare = shutil.which("cyclictest") is not None
    loads = [("calm", False)]
    notes = [
        "calm: no process started except the loop with its supervisor and logger, or cyclictest",
        "busy: a process computing without end on the first core, in loop and cyclictest blocks",
    ]
    if not compare:
        notes.append(NO_CYCLICTEST)
    if len(os.sched_getaffinity(0)) > 1:
        loads.append(("busy", True))
    else:
        notes.append("no busy blocks: this host has one core")
    figures: list[Figure] = []
    refused: set[str] = set()
    with tempfile.TemporaryDirectory() as scratch:
        for name, busy in loads:
            found = alternate_blocks(Path(scratch), seconds, pairs, busy=busy, compare=compare)
            figures += _figures(name, found)
            refused.update(why for block in found.loop for why in block.refused)
    notes += [f"not granted to the loop, so not the same terms: {why}" for why in sorted(refused)]
    return Result(
        "lateness",
        f"wake-up of the real-time loop at {1e6 / INTERVAL_US:g} Hz, FIFO {PRIORITY}, last core",
        f"{2 * pairs if compare else pairs} blocks of {seconds:g} s under each load"
        + (", loop and cyclictest alternating" if compare else ""),
        tuple(figures),
        tuple(notes),
    )
