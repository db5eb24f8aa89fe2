"""Size of an export before it is written, from a sample of the record.

The sample is some chunks of the record, evenly spread, so it takes no time that grows with the run.
"""

import shutil
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from rig.recording.runs import RunError, reader

LARGE_BYTES = 100_000_000
"""Size of an export from which a person is warned of it."""

_SAMPLE_CHUNKS = 16  # about 7000 ticks of a WaveBot
_UNITS = ((1e9, "GB"), (1e6, "MB"), (1e3, "kB"))


class ExportSize(NamedTuple):
    """Estimated size of an export."""

    samples: int  # at most
    fields: int
    bytes: int

    @property
    def text(self) -> str:
        """Size, samples and fields as text."""
        amount = f"about {format_bytes(self.bytes)}"
        return f"{amount} ({self.samples:,} samples of {self.fields} fields)"


def format_bytes(count: float) -> str:
    """Return a number of bytes with its decimal unit."""
    scale, unit = next((each for each in _UNITS if count >= each[0]), (1.0, "bytes"))
    return f"{count / scale:.3g} {unit}"


def sample_record(source: reader.RunFiles, fields: Sequence[str]) -> dict[str, Any]:
    """Return the fields of some ticks, evenly spread over the record; empty for an empty one."""
    spread = []
    for contents in source.contents:
        every = -(-len(contents.chunks) // _SAMPLE_CHUNKS) or 1
        spread.append(contents._replace(chunks=contents.chunks[every // 2 :: every]))
    stage = reader.Stage(tuple(spread))
    blocks = [*reader.blocks(source._replace(stages=(stage,)), None, fields)]
    return {name: np.concatenate([block[name] for block in blocks]) for name in fields if blocks}


def text_size(source: reader.RunFiles, fields: Sequence[str], samples: int) -> ExportSize:
    """Return the size of a table as text: numbers that read back exactly, and separators."""
    return _scale(source, fields, samples, lambda c: len(c) + sum(map(len, map(repr, c.tolist()))))


def packed_size(source: reader.RunFiles, fields: Sequence[str], samples: int) -> ExportSize:
    """Return the size of binary columns that are compressed one by one (zlib, level 1)."""
    return _scale(source, fields, samples, lambda c: len(zlib.compress(c.tobytes(), 1)))


def _scale(
    source: reader.RunFiles, fields: Sequence[str], samples: int, count: Callable[[Any], int]
) -> ExportSize:
    """Return the size by the bytes that ``count`` finds for each column of a sample of ticks."""
    columns = sample_record(source, list(dict.fromkeys(fields)))
    ticks = max((len(column) for column in columns.values()), default=1)
    total = sum(count(columns[name]) for name in fields if name in columns)
    return ExportSize(samples, len(fields), round(samples * total / ticks))


def check_room(path: Path, size: ExportSize, *, force: bool = False) -> str:
    """Return a warning of a large export; empty for a small one.

    Raises RunError, unless ``force``, if the disk of ``path`` has not room enough.
    """
    folder = path.resolve().parent
    if not folder.is_dir() or (path.exists() and not path.is_file()):
        return ""  # writing reports the error; a device or a pipe needs no room
    free = shutil.disk_usage(folder).free
    text = f"{path}: {size.text}; {format_bytes(free)} free in {folder}"
    if size.bytes > free and not force:
        raise RunError(
            f"{text}: too little room; choose fewer fields or rows, a lower rate or another disk, "
            "or write all the same: --force"
        )
    return text if size.bytes > min(LARGE_BYTES, free) else ""
