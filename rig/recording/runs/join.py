"""Join the parts that killed loggers left into one finished record."""

import contextlib
import json
import os
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.recording.mcap_writer import CLOCK_RECORD, START_KEY, RowWriter
from rig.recording.runs import mcap_file
from rig.recording.runs.mcap_file import FileContents, Records, RunError
from rig.recording.runs.state import RECOVERY
from rig.recording.runs.verify import read_back

_FLUSH_ROWS = 50_000  # rows in memory while joining


class SalvagedFile(NamedTuple):
    """Readable content of one file."""

    path: Path
    contents: FileContents
    blocks: tuple[Records, ...]  # the rows
    rows: int
    first_tick: int | None
    last_tick: int | None
    finished: bool  # the file's writer finished it
    unread: int  # bytes at a cut-off end or in damaged places
    damage: tuple[str, ...]  # damaged places that were skipped


class JoinResult(NamedTuple):
    """Result of joining the parts of a run."""

    path: Path
    rows: int
    duplicates: int  # rows dropped because an earlier part has their tick
    missing: int  # ticks between first and last that no part holds
    gaps: tuple[tuple[int, int], ...]  # first and last missing tick of each gap
    unread: int  # bytes
    damage: tuple[str, ...]
    crc: int  # CRC-32 of the packed rows in order

    @property
    def clean(self) -> bool:
        """Whether nothing is missing or damaged between the first and the last row."""
        return self.missing == 0 and not self.damage


def salvage(path: str | os.PathLike[str]) -> SalvagedFile:
    """Return every whole row of a file, finished or not.

    Damaged places are skipped and reported. Raise RunError if the file has no description of its
    rows, or if it has data and none is readable: an unreadable file is never an empty success.
    """
    contents = mcap_file.scan(path)
    damage = list(contents.damage)
    blocks = tuple(mcap_file.blocks(contents, damage))
    rows = sum(len(block) for block in blocks)
    if rows == 0 and contents.chunks:
        raise RunError(f"{path}: none of its {len(contents.chunks)} chunks is readable")
    ends = [int(block["tick"][i]) for block in blocks if len(block) for i in (0, -1)]
    return SalvagedFile(
        contents.path,
        contents,
        blocks,
        rows,
        ends[0] if ends else None,
        ends[-1] if ends else None,
        contents.finished,
        contents.unread,
        tuple(damage),
    )


def join(segments: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str]) -> JoinResult:
    """Join the parts of a run, given in the order of writing, into one finished MCAP file.

    Rows come out in order, each tick once; attachments and metadata of all parts are kept, the
    latest of a name counts. The parts remain unchanged. A part without a complete head (its logger
    died in its first moments) is reported as damage. A summary of joined and missing rows is
    attached as `RECOVERY`. The file gets its name only once it is whole, read back and on disk.
    Raise RunError if no part can be read or the parts do not belong together, FileExistsError if
    ``out`` exists, OSError if it cannot be written.
    """
    out = Path(out)
    if out.exists():
        raise FileExistsError(f"{out} exists already")
    parts, damage = _open(segments)
    first = parts[0]
    if any(part.schema != first.schema for part in parts):
        raise RunError(f"{first.path.parent}: the parts hold rows of different kinds")
    attachments: dict[str, bytes] = {}
    metadata: dict[str, dict[str, str]] = {}
    for part in parts:
        attachments |= part.attachments
        metadata |= part.metadata
    start = _start(parts)
    temporary = out.with_name(out.name + ".joining")
    temporary.unlink(missing_ok=True)
    writer = RowWriter(temporary, first.schema, attachments, metadata, start_utc_ns=start)
    try:
        joined = _copy(parts, writer, out, damage)
        writer.attach(RECOVERY, _recovery_record(parts, joined))
        writer.finish()
        _sync(temporary)
        written = read_back(temporary, 8 * len(first.leaves))  # before it gets its name
        if (written.rows, written.crc) != (joined.rows, joined.crc):
            raise RunError(f"{out}: the joined file does not hold what was written")
        temporary.rename(out)
        _sync(out.parent)
    except BaseException:
        writer.close()
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    return joined


def _start(parts: list[FileContents]) -> int:
    """Return the UTC of run time zero (ns) of all parts; of the first row if no part has it."""
    texts = [part.metadata.get(CLOCK_RECORD, {}).get(START_KEY, "") for part in parts]
    starts = {int(text) for text in texts if text.isdigit()}
    if len(starts) > 1:
        raise RunError(f"{parts[0].path.parent}: the parts do not agree on the run's start")
    for part in parts if not starts else []:
        start = mcap_file.utc_of_zero(part)
        if start is not None:
            return start
    return starts.pop() if starts else 0


def _sync(path: Path) -> None:
    """Wait until a file, or the names in a folder, would survive a power cut."""
    fd = os.open(path, os.O_RDONLY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def _recovery_record(parts: list[FileContents], joined: JoinResult) -> bytes:
    record = {
        "parts": [part.path.name for part in parts],
        "rows": joined.rows,
        "duplicates": joined.duplicates,
        "absent_ticks": [list(gap) for gap in joined.gaps],
        "unread_bytes": joined.unread,
        "damage": joined.damage,
    }
    return json.dumps(record, indent=2).encode()


def _open(segments: Sequence[str | os.PathLike[str]]) -> tuple[list[FileContents], list[str]]:
    parts: list[FileContents] = []
    damage: list[str] = []
    for path in segments:
        try:
            parts.append(mcap_file.scan(path))
        except RunError as error:
            damage.append(str(error))
        else:
            damage += parts[-1].damage
    if not parts:
        raise RunError(f"{'; '.join(damage) or 'no parts to join'}; {mcap_file.UNREADABLE_HINT}")
    return parts, damage


def _copy(parts: list[FileContents], writer: RowWriter, out: Path, damage: list[str]) -> JoinResult:
    last: int | None = None
    rows = duplicates = missing = crc = 0
    gaps: list[tuple[int, int]] = []
    for block in mcap_file.merged_blocks(parts, damage):
        if len(block) == 0:
            continue
        # A tick may also repeat within a part, if its logger read the ring again.
        ticks = block["tick"].astype(np.int64)
        start = [ticks[0] - 1 if last is None else last]
        before = np.maximum.accumulate(np.concatenate((start, ticks)))[:-1]
        kept = ticks > before
        duplicates += int(len(ticks) - kept.sum())
        if not kept.any():
            continue
        kept_ticks, previous_ticks = ticks[kept], before[kept]
        for i in np.flatnonzero(kept_ticks - previous_ticks > 1).tolist():
            gaps.append((int(previous_ticks[i]) + 1, int(kept_ticks[i]) - 1))
            missing += int(kept_ticks[i] - previous_ticks[i]) - 1
        last = int(kept_ticks[-1])
        rows += len(kept_ticks)
        packed = np.ascontiguousarray(block[kept]).tobytes()
        crc = zlib.crc32(packed, crc)
        writer.append(packed)
        if writer.pending > _FLUSH_ROWS * parts[0].stride:
            writer.flush()
    if rows == 0 and any(part.chunks for part in parts):
        raise RunError(f"{out}: none of the parts' rows is readable: {'; '.join(damage)}")
    unread = sum(part.unread for part in parts)
    return JoinResult(out, rows, duplicates, missing, tuple(gaps), unread, tuple(damage), crc)
