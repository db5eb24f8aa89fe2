"""Join the parts that killed loggers left into one finished record."""

import contextlib
import json
import os
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.recording.mcap_writer import CLOCK_RECORD, START_KEY, RowWriter
from rig.recording.runs import mcap_file
from rig.recording.runs.mcap_file import FileContents, Records
from rig.recording.runs.mcap_records import RunError
from rig.recording.runs.state import RECOVERY, TickCounter
from rig.recording.runs.verify import read_back

_FLUSH_ROWS = 50_000  # rows in memory while joining


class JoinResult(NamedTuple):
    """Result of joining the parts of a run."""

    path: Path
    rows: int
    duplicates: int  # rows dropped because an earlier part has their tick
    gaps: tuple[tuple[int, int], ...]  # first and last missing tick of each gap
    unread: int  # bytes
    damage: tuple[str, ...]
    crc: int  # CRC-32 of the packed rows in order

    @property
    def missing(self) -> int:
        """Number of ticks between first and last that no part holds."""
        return sum(last - first + 1 for first, last in self.gaps)

    @property
    def clean(self) -> bool:
        """Whether nothing is missing or damaged between the first and the last row."""
        return self.missing == 0 and not self.damage


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
    parts, damage = mcap_file.scan_all(segments)
    if not parts:
        raise RunError(f"{'; '.join(damage) or 'no parts to join'}; {mcap_file.UNREADABLE_HINT}")
    first = parts[0]
    if any(part.schema != first.schema for part in parts):
        raise RunError(f"{first.path.parent}: the parts hold rows of different kinds")
    attachments, metadata = mcap_file.merge_descriptions(parts)
    temporary = out.with_name(out.name + ".joining")
    temporary.unlink(missing_ok=True)
    writer = RowWriter(temporary, first.schema, attachments, metadata, start_utc_ns=_start(parts))
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
    if starts:
        return starts.pop()
    from_rows = (mcap_file.utc_of_zero(part) for part in parts)
    return next((start for start in from_rows if start is not None), 0)


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


def _copy(parts: list[FileContents], writer: RowWriter, out: Path, damage: list[str]) -> JoinResult:
    read = crc = 0
    counter = TickCounter()

    def count_read() -> Iterator[Records]:
        nonlocal read
        for block in mcap_file.merged_blocks(parts, damage):
            read += len(block)
            yield block

    for block in mcap_file.unrepeated(count_read()):
        counter.add(block)
        packed = np.ascontiguousarray(block).tobytes()
        crc = zlib.crc32(packed, crc)
        writer.append(packed)
        if writer.pending > _FLUSH_ROWS * parts[0].stride:
            writer.flush()
    account = counter.result(None)
    if account.first_tick is None and any(part.chunks for part in parts):
        raise RunError(f"{out}: none of the parts' rows is readable: {'; '.join(damage)}")
    gaps = [(gap.first, gap.last) for gap in account.gaps if gap.first > (account.first_tick or 0)]
    return JoinResult(
        path=out,
        rows=account.rows,
        duplicates=read - account.rows,
        gaps=tuple(gaps),
        unread=sum(part.unread for part in parts),
        damage=tuple(damage),
        crc=crc,
    )
