"""One finished record out of what killed loggers left."""

import contextlib
import json
import os
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.recording.mcap_writer import RowWriter
from rig.recording.row_schema import CLOCK, START_KEY, Form
from rig.recording.runs import mcap_file
from rig.recording.runs.mcap_file import Contents, Records, RunError
from rig.recording.runs.state import RECOVERY
from rig.recording.runs.verify import read_back

_FLUSH_ROWS = 50_000  # rows held in memory while joining


class Salvaged(NamedTuple):
    """What could be read of one file."""

    path: Path
    contents: Contents
    blocks: tuple[Records, ...]  # the rows
    rows: int
    first_tick: int | None
    last_tick: int | None
    finished: bool  # the writer ended the file itself
    unread: int  # bytes at a torn end or in damaged places
    damage: tuple[str, ...]  # whole places that had to be skipped


class Joined(NamedTuple):
    """Outcome of joining the parts of a run."""

    path: Path
    rows: int
    duplicates: int  # rows dropped because an earlier part has their tick
    missing: int  # ticks between first and last that no part holds
    gaps: tuple[tuple[int, int], ...]  # first and last missing tick of each gap
    unread: int  # bytes
    damage: tuple[str, ...]
    crc: int  # CRC-32 of the packed rows, one after the other

    @property
    def clean(self) -> bool:
        """Nothing is missing or damaged between the first and the last row."""
        return self.missing == 0 and not self.damage


def salvage(path: str | os.PathLike[str]) -> Salvaged:
    """Every whole row of a file, whether its writer ended it or was killed.

    Damaged places are skipped and told. Raises RunError if nothing says what its rows are, or if
    it has data and none of it can be read: an unreadable file is never an empty success.
    """
    contents = mcap_file.scan(path)
    damage = list(contents.damage)
    blocks = tuple(mcap_file.blocks(contents, damage))
    rows = sum(len(block) for block in blocks)
    if rows == 0 and contents.chunks:
        raise RunError(f"{path}: none of its {len(contents.chunks)} chunks is readable")
    ends = [int(block["tick"][i]) for block in blocks if len(block) for i in (0, -1)]
    return Salvaged(
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


def join(segments: Sequence[str | os.PathLike[str]], out: str | os.PathLike[str]) -> Joined:
    """One finished MCAP file from the parts of a run, given in the order they were written.

    Rows come out in order, each tick once; attachments and metadata of all parts are kept, the
    latest of a name counts. The parts are left as they are. A part that was created but never got
    its head (the logger died in its first moments) is told as damage. What was joined and what is
    missing is attached as `RECOVERY`. The file has its name only once it is whole, read back and on
    the disk. Raises RunError if no part can be read or the parts do not belong together,
    FileExistsError if ``out`` is there, OSError if it cannot be written.
    """
    out = Path(out)
    if out.exists():
        raise FileExistsError(f"{out} is there already")
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
    form = Form(first.schema_name, first.schema)
    writer = RowWriter(temporary, form, attachments, metadata, start_utc_ns=start)
    try:
        joined = _copy(parts, writer, out, damage)
        writer.attach(RECOVERY, _told(parts, joined))
        writer.finish()
        _settle(temporary)
        seen = read_back(temporary, 8 * len(first.leaves))  # before it is called done
        if (seen.rows, seen.crc) != (joined.rows, joined.crc):
            raise RunError(f"{out}: the joined file does not hold what was written")
        temporary.rename(out)
        _settle(out.parent)
    except BaseException:
        writer.close()
        with contextlib.suppress(OSError):
            temporary.unlink()
        raise
    return joined


def _start(parts: list[Contents]) -> int:
    """UTC of run time zero, ns, on which all parts agree; of the first row where none says it."""
    said = [part.metadata.get(CLOCK, {}).get(START_KEY, "") for part in parts]
    starts = {int(text) for text in said if text.isdigit()}
    if len(starts) > 1:
        raise RunError(f"{parts[0].path.parent}: the parts do not agree on the run's start")
    for part in parts if not starts else []:
        start = mcap_file.utc_of_zero(part)
        if start is not None:
            return start
    return starts.pop() if starts else 0


def _settle(path: Path) -> None:
    """Wait until a file, or the names in a folder, would survive a power cut."""
    fd = os.open(path, os.O_RDONLY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def _told(parts: list[Contents], joined: Joined) -> bytes:
    told = {
        "parts": [part.path.name for part in parts],
        "rows": joined.rows,
        "duplicates": joined.duplicates,
        "absent_ticks": [list(gap) for gap in joined.gaps],
        "unread_bytes": joined.unread,
        "damage": joined.damage,
    }
    return json.dumps(told, indent=2).encode()


def _open(segments: Sequence[str | os.PathLike[str]]) -> tuple[list[Contents], list[str]]:
    parts: list[Contents] = []
    damage: list[str] = []
    for path in segments:
        try:
            parts.append(mcap_file.scan(path))
        except RunError as error:
            damage.append(str(error))
        else:
            damage += parts[-1].damage
    if not parts:
        raise RunError(f"{'; '.join(damage) or 'no parts to join'}; {mcap_file.HOPELESS}")
    return parts, damage


def _copy(parts: list[Contents], writer: RowWriter, out: Path, damage: list[str]) -> Joined:
    last: int | None = None
    rows = duplicates = missing = crc = 0
    gaps: list[tuple[int, int]] = []
    for block in mcap_file.merged(parts, damage):
        if len(block) == 0:
            continue
        # Within a part, too, a tick may come twice if its logger read the ring again.
        ticks = block["tick"].astype(np.int64)
        so_far = [ticks[0] - 1 if last is None else last]
        before = np.maximum.accumulate(np.concatenate((so_far, ticks)))[:-1]
        kept = ticks > before
        duplicates += int(len(ticks) - kept.sum())
        if not kept.any():
            continue
        ahead, behind = ticks[kept], before[kept]
        for i in np.flatnonzero(ahead - behind > 1).tolist():
            gaps.append((int(behind[i]) + 1, int(ahead[i]) - 1))
            missing += int(ahead[i] - behind[i]) - 1
        last = int(ahead[-1])
        rows += len(ahead)
        packed = np.ascontiguousarray(block[kept]).tobytes()
        crc = zlib.crc32(packed, crc)
        writer.append(packed)
        if writer.pending > _FLUSH_ROWS * parts[0].stride:
            writer.flush()
    if rows == 0 and any(part.chunks for part in parts):
        raise RunError(f"{out}: none of the parts' rows is readable: {'; '.join(damage)}")
    unread = sum(part.unread for part in parts)
    return Joined(out, rows, duplicates, missing, tuple(gaps), unread, tuple(damage), crc)
