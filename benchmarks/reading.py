"""Open an hour of rows, ten fields and all, in fresh processes; compare with the stock reader."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from mcap.reader import make_reader

from benchmarks.support.live_run import live_run
from benchmarks.support.recorded import ROOT, campaign_file
from benchmarks.support.result import Result, figure, ratios
from rig.kinds.wavebot.tick import KIND
from rig.recording.mcap_writer import TOPIC, RowWriter
from rig.recording.row_layout import CDR_HEADER, leaves, schema
from rig.recording.runs import mcap_file, open_run

SECONDS, MEMORY_MB = 5.0, 400.0
SECONDS_PER_GB = 6.0  # of rows: what is decoded and given; a file is a quarter of that or less
HOUR = 3_600_000  # rows
TEN = (
    "plan.row",
    "plan.phase",
    "heave.estimate.position",
    "heave.estimate.velocity",
    "heave.command.force",
    "heave.sense.current",
    "load.lcb",
    "power.mechanical_1",
    "power.ac",
    "wave.elevation",
)
DT = 0.001


def rehearsed(folder: Path, seconds: float) -> mcap_file.Records:
    """Rows of a rehearsal in this folder."""
    with live_run(campaign_file(folder, seconds), folder / "runs", real_clock=False) as run:
        run.wait_started()
        run.wait_ended()
    contents = mcap_file.scan(run.folder / "run.mcap")
    return np.concatenate(list(mcap_file.blocks(contents)))


def write_tiled(path: Path, rows: mcap_file.Records, count: int) -> None:
    """A file of ``count`` rows: the rehearsal's again and again, tick and time going on."""
    writer = RowWriter(path, schema(KIND.row_type), {}, {}, start_utc_ns=0)
    tile, done = rows.copy(), 0
    while done < count:
        tile["tick"] = tile["tick_end"] = np.arange(done, done + len(rows))
        tile["time"] = tile["tick"] * DT
        writer.append(tile[: count - done].tobytes())
        writer.flush()
        done += len(rows)
    writer.flush(durable=True)
    writer.finish()


class Opened(NamedTuple):
    """A run opened in a fresh process."""

    whole: float  # s, interpreter start to exit
    call: float  # s, open_run alone, its own imports included
    peak: float  # MB


def opened(path: Path, fields: tuple[str, ...], rows: int, *, alone: bool = True) -> Opened:
    """Open a run in a process of its own, ``alone`` with what the project needs."""
    began = perf_counter()
    options = ["--alone"] if alone else []
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.support.read_process", *options, str(path), *fields],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    whole = perf_counter() - began
    report: dict[str, Any] = json.loads(done.stdout)
    if report["rows"] != rows:
        raise RuntimeError(f"{report['rows']} rows were read, {rows} written")
    return Opened(whole, report["seconds"], report["peak"] / 1e6)


def forget(path: Path) -> None:
    """Ask the system to drop a file from its cache."""
    fd = os.open(path, os.O_RDONLY)
    try:
        os.posix_fadvise(fd, 0, 0, os.POSIX_FADV_DONTNEED)
    finally:
        os.close(fd)


def ours(path: Path) -> float:
    """Seconds to open all fields."""
    began = perf_counter()
    open_run(path)
    return perf_counter() - began


def stock(path: Path) -> float:
    """Seconds to get all fields as arrays with the stock reader, numbers decoded in one go."""
    kinds = [(leaf.name, "<f8" if leaf.code == "d" else "<i8") for leaf in leaves(KIND.row_type)]
    began = perf_counter()
    with path.open("rb") as file:
        messages = make_reader(file).iter_messages(topics=[TOPIC])
        packed = b"".join(message.data[len(CDR_HEADER) :] for _, _, message in messages)
    rows = np.frombuffer(packed, np.dtype(kinds))
    columns = {name: np.ascontiguousarray(rows[name]) for name, _ in kinds}
    assert len(columns["tick"]) == len(rows)
    return perf_counter() - began


def measure(short: bool) -> Result:
    """Write an hour of rows, open it again and again in fresh processes, then a slice of it."""
    count, repetitions, slice_rows = (60_000, 2, 10_000) if short else (HOUR, 5, 100_000)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        rows = rehearsed(folder, 20.0 if short else 110.0)
        path, part = folder / "hour.mcap", folder / "slice.mcap"
        write_tiled(path, rows, count)
        write_tiled(part, rows, slice_rows)
        forget(path)
        cold = opened(path, TEN, count)
        ten, among, everything = list[Opened](), list[Opened](), list[Opened]()
        for _ in range(repetitions):
            ten.append(opened(path, TEN, count))
            among.append(opened(path, TEN, count, alone=False))
            everything.append(opened(path, (), count))
        ours(part)  # imports and caches, so that the first block is like the others
        mine, theirs = list[float](), list[float]()
        for _ in range(repetitions):
            mine.append(ours(part))
            theirs.append(stock(part))
        on_disk = path.stat().st_size / 1e9
    unpacked = count * rows.dtype.itemsize / 1e9
    return Result(
        "reading",
        f"open_run of {count} rows ({count * DT / 60:g} min at 1 kHz, {on_disk:.3g} GB on disk, "
        f"{unpacked:.3g} GB of rows)",
        f"{repetitions} fresh processes each with ten fields and with all, alternating; "
        f"{repetitions} blocks of {slice_rows} rows compared with the stock reader",
        (
            figure("ten fields, whole process", "s", [e.whole for e in ten], at_most=SECONDS),
            figure("ten fields, open_run alone", "s", [e.call for e in ten]),
            figure("ten fields, file not in cache", "s", cold.whole),
            figure("ten fields, peak memory", "MB", [e.peak for e in ten], at_most=MEMORY_MB),
            figure("ten fields, whole process with Dask, Arrow", "s", [e.whole for e in among]),
            figure("ten fields, peak memory with Dask, Arrow", "MB", [e.peak for e in among]),
            figure(
                "all fields, open_run",
                "s per GB of rows",
                [e.call / unpacked for e in everything],
                at_most=None if short else SECONDS_PER_GB,
            ),
            figure(
                "all fields, open_run", "s per GB of file", [e.call / on_disk for e in everything]
            ),
            figure("all fields, peak memory", "MB", [e.peak for e in everything]),
            figure("stock reader / open_run, all fields", "ratio", ratios(theirs, mine)),
        ),
        (
            ("short form: a minute instead of an hour, where the imports are most of the time",)
            if short
            else ()
        ),
    )
