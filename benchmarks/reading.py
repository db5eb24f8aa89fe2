"""Open an hour of rows, ten fields and all, in new processes; compare with the stock reader."""

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
from benchmarks.support.recorded import ROOT, write_campaign_file
from benchmarks.support.result import Result, figure, ratios
from rig.kinds.wavebot.tick import KIND
from rig.recording.mcap_writer import TOPIC, RowWriter
from rig.recording.row_layout import CDR_HEADER, leaves, schema
from rig.recording.runs import mcap_file, open_run

MAX_SECONDS, MAX_MEMORY_MB = 5.0, 400.0
MAX_SECONDS_PER_GB = 6.0  # of decoded rows; the file has a quarter of that size or less
HOUR_ROWS = 3_600_000  # rows
TEN_FIELDS = (
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


def rehearse_rows(folder: Path, seconds: float) -> mcap_file.Records:
    """Rehearse a campaign in this folder; return its rows."""
    with live_run(write_campaign_file(folder, seconds), folder / "runs", real_clock=False) as run:
        run.wait_started()
        run.wait_ended()
    contents = mcap_file.scan(run.folder / "run.mcap")
    return np.concatenate(list(mcap_file.blocks(contents)))


def write_tiled(path: Path, rows: mcap_file.Records, count: int) -> None:
    """Write a file of ``count`` rows that repeats the given rows with continuous tick and time."""
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


class OpenCost(NamedTuple):
    """Cost of opening a run in a new process."""

    process_s: float  # interpreter start to exit
    open_run_s: float  # open_run alone, including its own imports
    peak_mb: float  # memory


def open_in_new_process(
    path: Path, fields: tuple[str, ...], rows: int, *, without_extras: bool = True
) -> OpenCost:
    """Open a run in a new process, ``without_extras`` with the project's dependencies alone."""
    began = perf_counter()
    options = ["--alone"] if without_extras else []
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.support.read_process", *options, str(path), *fields],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    process_s = perf_counter() - began
    report: dict[str, Any] = json.loads(done.stdout)
    if report["rows"] != rows:
        raise RuntimeError(f"{report['rows']} rows were read, {rows} written")
    return OpenCost(process_s, report["seconds"], report["peak"] / 1e6)


def drop_from_cache(path: Path) -> None:
    """Ask the operating system to drop a file from its cache."""
    fd = os.open(path, os.O_RDONLY)
    try:
        os.posix_fadvise(fd, 0, 0, os.POSIX_FADV_DONTNEED)
    finally:
        os.close(fd)


def time_open_run(path: Path) -> float:
    """Return the seconds to open all fields."""
    began = perf_counter()
    open_run(path)
    return perf_counter() - began


def time_stock_reader(path: Path) -> float:
    """Return the seconds of the stock reader for all fields as arrays, decoded in one call."""
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
    """Write an hour of rows, open it repeatedly in new processes, then a slice of it."""
    count, repetitions, slice_rows = (60_000, 2, 10_000) if short else (HOUR_ROWS, 5, 100_000)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        rows = rehearse_rows(folder, 20.0 if short else 110.0)
        path, slice_path = folder / "hour.mcap", folder / "slice.mcap"
        write_tiled(path, rows, count)
        write_tiled(slice_path, rows, slice_rows)
        drop_from_cache(path)
        cold = open_in_new_process(path, TEN_FIELDS, count)
        ten, with_extras, everything = list[OpenCost](), list[OpenCost](), list[OpenCost]()
        for _ in range(repetitions):
            ten.append(open_in_new_process(path, TEN_FIELDS, count))
            with_extras.append(open_in_new_process(path, TEN_FIELDS, count, without_extras=False))
            everything.append(open_in_new_process(path, (), count))
        time_open_run(
            slice_path
        )  # fills imports and caches, so that the first block is like the others
        open_run_s, stock_s = list[float](), list[float]()
        for _ in range(repetitions):
            open_run_s.append(time_open_run(slice_path))
            stock_s.append(time_stock_reader(slice_path))
        on_disk = path.stat().st_size / 1e9
    unpacked = count * rows.dtype.itemsize / 1e9
    return Result(
        "reading",
        f"open_run of {count} rows ({count * DT / 60:g} min at 1 kHz, {on_disk:.3g} GB on disk, "
        f"{unpacked:.3g} GB of rows)",
        f"{repetitions} fresh processes each with ten fields and with all, alternating; "
        f"{repetitions} blocks of {slice_rows} rows compared with the stock reader",
        (
            figure(
                "ten fields, whole process", "s", [e.process_s for e in ten], at_most=MAX_SECONDS
            ),
            figure("ten fields, open_run alone", "s", [e.open_run_s for e in ten]),
            figure("ten fields, file not in cache", "s", cold.process_s),
            figure(
                "ten fields, peak memory", "MB", [e.peak_mb for e in ten], at_most=MAX_MEMORY_MB
            ),
            figure(
                "ten fields, whole process with Dask, Arrow",
                "s",
                [e.process_s for e in with_extras],
            ),
            figure(
                "ten fields, peak memory with Dask, Arrow", "MB", [e.peak_mb for e in with_extras]
            ),
            figure(
                "all fields, open_run",
                "s per GB of rows",
                [e.open_run_s / unpacked for e in everything],
                at_most=None if short else MAX_SECONDS_PER_GB,
            ),
            figure(
                "all fields, open_run",
                "s per GB of file",
                [e.open_run_s / on_disk for e in everything],
            ),
            figure("all fields, peak memory", "MB", [e.peak_mb for e in everything]),
            figure("stock reader / open_run, all fields", "ratio", ratios(stock_s, open_run_s)),
        ),
        (
            ("short form: a minute instead of an hour, where the imports are most of the time",)
            if short
            else ()
        ),
    )
