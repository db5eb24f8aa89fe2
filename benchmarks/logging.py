"""Cost of a row from the ring to the file, by step, beside the writer of the `mcap` library."""

import ctypes
import os
import tempfile
from pathlib import Path
from time import perf_counter, process_time, thread_time
from typing import NamedTuple

import numpy as np
from mcap.writer import CompressionType, Writer

from benchmarks.reading import rehearse_rows
from benchmarks.support.result import Result, figure, ratios
from rig.kinds.wavebot.tick import KIND
from rig.processes.logger import BLOCK_ROWS, TimingCertificate, keep_freed_memory
from rig.recording import ring
from rig.recording.mcap_writer import CHUNK_BYTES, TOPIC, RowWriter
from rig.recording.row_layout import CDR_HEADER, schema
from rig.recording.runs.mcap_file import Records

MAX_ROW_US = 2.0
_SCHEMA = schema(KIND.row_type)


class Ring(NamedTuple):
    """Both ends of a ring in this process."""

    writer: ring.RingWriter
    reader: ring.RingReader


def open_ring() -> Ring:
    """Return a new ring of which a poll takes all rows."""
    fd = ring.create(KIND.row_type)
    ends = Ring(ring.RingWriter(fd, KIND.row_type, wait=False), ring.RingReader(fd))
    os.close(fd)
    ends.writer.finish()
    return ends


class LogCost(NamedTuple):
    """Cost of a row; the steps are processor time of the logger's main thread."""

    take: float  # us
    frame: float  # us
    certify: float  # us
    write: float  # us, flush
    processor: float  # us, both threads
    wall: float  # us
    size: float  # bytes in the file


def fill(writer: ring.RingWriter, rows: Records) -> None:
    """Put packed rows into the ring."""
    address, size = rows.ctypes.data, rows.dtype.itemsize
    for i in range(len(rows)):
        place, _ = writer.reserve()
        ctypes.memmove(place, address + i * size, size)
        writer.publish()


def log_rows(ends: Ring, rows: Records, path: Path) -> LogCost:
    """Log the rows by the steps of `rig.processes.logger`, a quarter of a ring at a time."""
    writer, reader = ends
    out = RowWriter(path, _SCHEMA, {}, {}, start_utc_ns=0)
    certificate = TimingCertificate(_SCHEMA.leaves)
    steps, processor, wall = np.zeros(4), 0.0, 0.0
    quarter = ring.CAPACITY // 4
    for start in range(0, len(rows), quarter):
        fill(writer, rows[start : start + quarter])
        began, wall_began = process_time(), perf_counter()
        while True:
            at = [thread_time()]
            block = reader.take(BLOCK_ROWS)
            at.append(thread_time())
            if not block:
                break
            out.append(block)
            at.append(thread_time())
            certificate.add(block)
            at.append(thread_time())
            steps[:3] += np.diff(at)
        at = [thread_time()]
        out.flush()
        reader.commit()
        steps[3] += thread_time() - at[0]
        processor, wall = processor + process_time() - began, wall + perf_counter() - wall_began
    out.finish()
    if writer.dropped or certificate.ticks != len(rows):
        raise RuntimeError("the ring or the certificate left rows out")
    us = 1e6 / len(rows)
    return LogCost(*(us * steps).tolist(), us * processor, us * wall, out.committed / len(rows))


def log_by_library(rows: Records, path: Path) -> float:
    """Write the rows with the `mcap` library, equal chunks; return the processor time (us) of one.

    It compresses with zstd's level 3, which cannot be chosen.
    """
    with path.open("xb") as file:
        writer = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        writer.start("ros2", "wec-rig")
        schema_id = writer.register_schema(_SCHEMA.name, "ros2msg", _SCHEMA.text.encode())
        channel = writer.register_channel(TOPIC, "cdr", schema_id)
        began = process_time()
        for i, seconds in enumerate(rows["time"].tolist()):
            at = round(seconds * 1e9)
            writer.add_message(channel, at, CDR_HEADER + rows[i].tobytes(), at, i)
        writer.finish()
        return 1e6 * (process_time() - began) / len(rows)


def measure(short: bool) -> Result:
    """Log the rows of a rehearsal repeatedly, with this project's writer and with the library's."""
    seconds, repetitions = (20.0, 2) if short else (110.0, 10)
    keep_freed_memory()
    ours, library, ends = list[LogCost](), list[float](), open_ring()
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        rows = np.ascontiguousarray(rehearse_rows(folder, seconds))
        path = folder / "run.mcap"
        while ends.reader.head < ring.CAPACITY:  # loads the ring's pages into memory
            log_rows(ends, rows, path)
            path.unlink()
        for _ in range(repetitions):
            ours.append(log_rows(ends, rows, path))
            path.unlink()
            library.append(log_by_library(rows, path))
            path.unlink()
    size, total = rows.dtype.itemsize, [cost.processor for cost in ours]
    return Result(
        "logging",
        f"rows of a WaveBot, {size // 8} numbers and {size} bytes each, from the ring to the file",
        f"{repetitions} repetitions with {len(rows)} rows of a rehearsal, alternating with the "
        "library's writer",
        (
            figure("row, both threads", "us of processor", total, at_most=MAX_ROW_US),
            figure("  take from the ring", "us of processor", [cost.take for cost in ours]),
            figure("  messages, waiting aside", "us of processor", [cost.frame for cost in ours]),
            figure("  certificate", "us of processor", [cost.certify for cost in ours]),
            figure("  write", "us of processor", [cost.write for cost in ours]),
            figure(
                "  compress, in the other thread",
                "us of processor",
                [c.processor - c.take - c.frame - c.certify - c.write for c in ours],
            ),
            figure("rows", "1/s", [1e6 / cost.wall for cost in ours]),
            figure("rows, before compression", "MB/s", [size / cost.wall for cost in ours]),
            figure("size of a row in the file", "bytes", [cost.size for cost in ours]),
            figure("row, writer of the mcap library", "us of processor", library),
            figure("rows, writer of the mcap library", "1/s", [1e6 / cost for cost in library]),
            figure("mcap library / row", "ratio", ratios(library, total)),
        ),
    )
