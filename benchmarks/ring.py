"""Cost of handing a row to the logger, and row loss while the logger is stalled."""

import json
import os
import signal
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from time import perf_counter_ns, process_time_ns
from typing import Any, NamedTuple

import numpy as np

from benchmarks.support.live_run import LOGGER, LOOP, LiveRun, live_run, resident_bytes
from benchmarks.support.recorded import (
    RecordedTicks,
    garbage_collection_off,
    record_ticks,
    write_campaign_file,
)
from benchmarks.support.result import Result, figure, quantile, ratios
from benchmarks.tick import compile_ticks, run_on_real_clock
from rig.kinds.wavebot.tick import KIND
from rig.realtime import cycle
from rig.realtime.requests import NO_REQUEST
from rig.recording import ring
from rig.recording.runs import open_run

MAX_IN_PLACE_US = 0.5  # of processor, of a row that is written in its place
MIN_RATIO = 10.0  # of a row put to one that is written in its place
MAX_GROWTH_MB = 1.0
BLOCK_TICKS = 200  # ticks
SETTLE_S = 1.0  # s after the first tick: memory before

_NO_TIMING = cycle.Timing(0.0, 0.0, 0)


class PutCost(NamedTuple):
    """Costs of alternating blocks, in microseconds per tick."""

    put: list[float]  # rows put one after another
    p99: list[float]
    cycle: list[float]  # the cycle alone
    added: list[float]  # to the cycle, by putting each row at once as the loop does
    in_place: list[float]  # rows reserved and published, as the compiled tick does


def measure_put_cost(recorded: RecordedTicks, blocks: int) -> PutCost:
    """Time puts of recorded rows, and recorded ticks with and without puts, in blocks."""
    fd = ring.create(KIND.row_type)
    writer, reader = ring.RingWriter(fd, KIND.row_type, wait=False), ring.RingReader(fd)
    os.posix_fallocate(fd, 0, os.fstat(fd).st_size)
    os.close(fd)
    costs = PutCost([], [], [], [], [])
    with garbage_collection_off():
        for block in range(blocks + 1):
            put, p99 = _time_puts(recorded, writer)
            _empty(reader)
            alone, added = _time_cycles(recorded, writer)
            _empty(reader)
            in_place = _time_rows_in_place(recorded, writer)
            _empty(reader)
            if block:  # the first block loads the ring's pages into memory
                for values, value in zip(costs, (put, p99, alone, added, in_place), strict=True):
                    values.append(value)
    if writer.dropped:
        raise RuntimeError("the ring was full, so that rows were dropped instead of put")
    return costs


def _time_puts(recorded: RecordedTicks, writer: ring.RingWriter) -> tuple[float, float]:
    """Return the mean processor time and the 99th percentile of the wall time of a put (us)."""
    put, now = writer.put, perf_counter_ns
    began = process_time_ns()
    for row in recorded.rows:
        put(row)
    mean = (process_time_ns() - began) / 1e3 / len(recorded.rows)
    single = []
    for row in recorded.rows:
        began = now()
        put(row)
        single.append(now() - began)
    return mean, quantile(single, 0.99) / 1e3


def _time_rows_in_place(recorded: RecordedTicks, writer: ring.RingWriter) -> float:
    """Return the mean processor time (us) of a place reserved and its row published."""
    reserve, publish = writer.reserve, writer.publish
    began = process_time_ns()
    for _ in recorded.rows:
        reserve()
        publish()
    return (process_time_ns() - began) / 1e3 / len(recorded.rows)


def _time_cycles(recorded: RecordedTicks, writer: ring.RingWriter) -> tuple[float, float]:
    """Return medians (us) over blocks: of the cycle alone, and of the time that a put adds."""
    step = cycle.make(KIND)
    params, dt, timing, now = recorded.params, recorded.dt, _NO_TIMING, process_time_ns

    def run_block(state: Any, start: int, put: Callable[[Any], None]) -> tuple[Any, float]:
        senses = recorded.senses[start : start + BLOCK_TICKS]
        began = now()
        for tick, sense in enumerate(senses, recorded.first + start):
            state, _, row = step(params, state, sense, NO_REQUEST, tick, timing, 1, dt)
            put(row)
        return state, (now() - began) / 1e3 / len(senses)

    state, alone, added = recorded.state, list[float](), list[float]()
    for i, start in enumerate(range(0, len(recorded.senses) - BLOCK_TICKS + 1, BLOCK_TICKS)):
        if i % 2:  # alternating, so that neither way always profits from the other's cache
            _, with_put = run_block(state, start, writer.put)
            after, without = run_block(state, start, _discard)
        else:
            after, without = run_block(state, start, _discard)
            _, with_put = run_block(state, start, writer.put)
        state = after
        alone.append(without)
        added.append(with_put - without)
    return float(np.median(alone)), float(np.median(added))


def _discard(row: Any) -> None:
    pass


def _empty(reader: ring.RingReader) -> None:
    while reader.pending:
        reader.take()
        reader.commit()


class StalledRun(NamedTuple):
    """A run on the real clock whose logger was suspended for a while."""

    ticks: int
    lost: int  # ticks or rows that are not in the file
    dropped: int
    max_backlog: int  # rows waiting in the ring
    growth: float  # MB of the loop's own memory, without the ring
    total_growth: float  # MB of all resident memory
    refused: tuple[str, ...]  # real-time privileges


def run_with_stalled_logger(folder: Path, seconds: float, stall: float) -> StalledRun:
    """Run on the real clock, suspend the logger in the middle for ``stall`` s, count rows."""
    campaign = write_campaign_file(folder, seconds + 30.0)
    with live_run(campaign, folder / "stalled", real_clock=True) as run:
        start = run.wait_started()
        loop, logger = run.pid(LOOP), run.pid(LOGGER)
        _max_backlog_until(run, start.time + min(SETTLE_S, seconds / 4))
        before = resident_bytes(loop)
        _max_backlog_until(run, start.time + (seconds - stall) / 2)
        os.kill(logger, signal.SIGSTOP)
        backlog = _max_backlog_until(run, time.monotonic() + stall)
        os.kill(logger, signal.SIGCONT)
        _max_backlog_until(run, start.time + seconds)
        after = resident_bytes(loop)
        run.stop()
        outcome = run.wait_ended()
        last = run.observe_tick().tick
        put = run.ring.head
    if outcome["status"] != "stopped":
        raise RuntimeError(f"the run ended too early: {outcome['reason']}")
    ticks = open_run(run.folder, fields=["tick"])["tick"].values
    executed = last + 1 - int(outcome["skipped"])
    return StalledRun(
        executed,
        max(executed, put, int(outcome["ticks"])) - len(ticks),
        int(outcome["dropped"]),
        backlog,
        _own_megabytes(after) - _own_megabytes(before),
        (after["all"] - before["all"]) / 1e6,
        refused_privileges(run.folder),
    )


def refused_privileges(folder: Path) -> tuple[str, ...]:
    """Return the real-time privileges that a run was not granted, with the reasons."""
    granted: dict[str, str] = json.loads((folder / "privileges.json").read_text())
    return tuple(f"{name}: {reason}" for name, reason in granted.items() if reason)


def _own_megabytes(resident: dict[str, int]) -> float:
    return (resident["private"] + resident["files"]) / 1e6


def _max_backlog_until(run: LiveRun, until: float) -> int:
    """Sleep until a time (s, monotonic); return the largest number of rows in the ring."""
    backlog = 0
    while time.monotonic() < until:
        backlog = max(backlog, run.ring.head - run.ring.tail)
        time.sleep(0.05)
    return backlog


def measure(short: bool) -> Result:
    """Measure a put next to the cycle and at the real rate, and a long run with a stall."""
    ticks, blocks, loops = (2000, 4, 1) if short else (10_000, 20, 3)
    seconds, stall = (20.0, 2.0) if short else (600.0, 5.0)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        path = write_campaign_file(folder, 60.0)
        compile_ticks(path)
        costs = measure_put_cost(record_ticks(path, ticks), blocks)
        real = [run_on_real_clock(path, "compiled", 2.0 if short else 10.0) for _ in range(loops)]
        run = run_with_stalled_logger(folder, seconds, stall)
    late = [one["us"]["ring"] for one in real]
    return Result(
        "ring",
        "handing a row to the logger through shared memory, and a suspended logger",
        f"{blocks} alternating blocks of {ticks} rows; {loops} loops at their real rate; one run "
        f"of {seconds:g} s at 1 kHz with the logger stopped for {stall:g} s in the middle",
        (
            figure(
                "row in its place, reserved and published",
                "us of processor",
                costs.in_place,
                at_most=MAX_IN_PLACE_US,
            ),
            figure("row put by the interpreted tick", "us of processor", costs.put),
            figure(
                "put / in its place", "x", ratios(costs.put, costs.in_place), at_least=MIN_RATIO
            ),
            figure("put, p99", "us", costs.p99),
            figure("put, added to the cycle", "us of processor", costs.added),
            figure("put / interpreted cycle", "ratio", ratios(costs.put, costs.cycle)),
            figure(
                "published, in a loop at its real rate, mean",
                "us a tick",
                [one["mean"] for one in late],
            ),
            figure(
                "published, in a loop at its real rate, p99", "us", [one["p99"] for one in late]
            ),
            figure("rows lost to the stall", "rows", run.lost, at_most=0),
            figure("rows dropped by the ring", "rows", run.dropped, at_most=0),
            figure("rows waiting in the ring at worst", "rows", run.max_backlog),
            figure("ticks of that run", "ticks", run.ticks),
            figure("memory growth of the loop", "MB", run.growth, at_most=MAX_GROWTH_MB),
            figure("  the same with the ring's pages", "MB", run.total_growth),
        ),
        tuple(f"on the real clock not granted: {reason}" for reason in run.refused),
    )
