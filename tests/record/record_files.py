"""WaveBot rows with a different number in every field, and files of them."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.kinds.wavebot.tick import WaveBotRow
from rig.recording import row_layout
from rig.recording.mcap_writer import RowWriter
from rig.recording.runs.mcap_file import blocks, row_dtype, scan

START = 1_760_000_000_000_000_000  # ns, UTC
DTYPE = row_dtype(row_layout.leaves(WaveBotRow))


def rows(count: int, first: int = 0, dt: float = 1e-3) -> Any:
    """Return ``count`` rows from tick ``first``; all fields of a row differ except the ticks."""
    block = np.zeros(count, DTYPE)
    ticks = np.arange(first, first + count)
    for column, name in enumerate(DTYPE.names or ()):
        block[name] = ticks * 100 + column
        if DTYPE[name] == np.float64:
            block[name] += 0.25
    block["tick"] = block["tick_end"] = ticks
    block["time"] = ticks * dt
    block["plan.row"] = ticks // 100
    return block


def writer(path: Path, **attachments: bytes) -> RowWriter:
    """Return a writer of WaveBot rows with the common start."""
    metadata = {"run": {"run": "test"}}
    return RowWriter(path, row_layout.schema(WaveBotRow), attachments, metadata, start_utc_ns=START)


def write(path: Path, data: Any, flush_every: int = 500, finish: bool = True) -> Path:
    """Write a file of these rows; without ``finish`` as a killed writer leaves it."""
    out = writer(path)
    for begin in range(0, len(data), flush_every):
        out.append(data[begin : begin + flush_every].tobytes())
        out.flush()
    if finish:
        out.finish()
    else:
        out.close()
    return path


class Salvaged(NamedTuple):
    """All that can be read of a file."""

    blocks: list[Any]
    rows: int
    last_tick: int | None
    finished: bool
    unread: int
    damage: list[str]


def salvage(path: Path) -> Salvaged:
    """Return every whole row of a file, finished or not."""
    contents = scan(path)
    damage = list(contents.damage)
    found = list(blocks(contents, damage))
    last = int(found[-1]["tick"][-1]) if found else None
    rows = sum(map(len, found))
    return Salvaged(found, rows, last, contents.finished, contents.unread, damage)
