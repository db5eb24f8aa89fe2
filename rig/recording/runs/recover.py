"""`rig recover`: one finished record from the remains of a crash, and an exact account of it.

The files that the crash left are never changed. The recovered file gets its name only once it is
whole, on disk and read back by the stock MCAP library. A second recovery finds the work done.
"""

import contextlib
import json
import os
import struct
import zlib
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import breakup_chunk, get_chunk_data_stream

from rig.realtime.reasons import ReasonTable
from rig.recording import row_layout
from rig.recording.folder_watch import PROGRESS
from rig.recording.mcap_writer import CLOCK_RECORD, MESSAGE_BYTES, START_KEY, RowWriter
from rig.recording.runs import create, folder, mcap_file
from rig.recording.runs.mcap_file import FileContents, Records
from rig.recording.runs.mcap_records import RunError
from rig.recording.runs.state import (
    LOOP,
    RECOVERY,
    EndReport,
    TickAccount,
    TickCounter,
    account_ticks,
    end_report,
    logger_status,
    read_json,
)
from rig.regular_file import open_regular

MAX_PARSED = 100_000  # messages parsed one by one, approximately
_REFUSED = (
    *(McapError, zstandard.ZstdError, struct.error, ValueError, EOFError),
    *(KeyError, MemoryError, RuntimeError, OverflowError),
)
_HEAD = 9  # bytes of opcode and length in front of a chunk


class ReadBack(NamedTuple):
    """Rows that the stock library finds."""

    rows: int
    crc: int  # CRC-32 of their packed bytes in file order
    parsed: int  # number of rows parsed message by message
    chunks: int  # chunks with a valid check sum


def read_back(path: str | os.PathLike[str], row_size: int) -> ReadBack:
    """Read every row of ``row_size`` bytes of a finished file with the stock MCAP library.

    The file must hold nothing but rows. The library takes 20 us a message, ten minutes for a day's
    record. Therefore it finds, decompresses and checks every chunk through the file's own index,
    but parses message by message only the first and last chunk and some in between, approximately
    `MAX_PARSED` messages; of the others it slices the rows at their known places. Raise RunError
    if the library rejects the file, or the file's own statistics disagree with its rows.
    """
    rows = crc = parsed = 0
    stride = MESSAGE_BYTES + row_size
    try:
        with open_regular(Path(path)) as file:
            summary = make_reader(file, validate_crcs=True).get_summary()
            if summary is None or summary.statistics is None:
                raise RunError(f"{path}: the mcap library finds no summary in it")
            indexes = summary.chunk_indexes
            stride_of_parsed = max(1, -(-summary.statistics.message_count // MAX_PARSED))
            for number, index in enumerate(indexes):
                file.seek(index.chunk_start_offset + _HEAD)
                chunk = Chunk.read(ReadDataStream(file))
                if number % stride_of_parsed == 0 or number == len(indexes) - 1:
                    data, count = _parse_messages(chunk)
                    parsed += count
                else:
                    data, count = _slice_rows(chunk, stride)
                crc = zlib.crc32(data, crc)
                rows += count
    except RunError:
        raise
    except _REFUSED as error:
        raise RunError(f"{path}: the mcap library refuses it: {error!r}") from error
    if summary.statistics.message_count != rows:
        raise RunError(f"{path}: its statistics do not count its rows")
    return ReadBack(rows, crc, parsed, len(indexes))


def _parse_messages(chunk: Chunk) -> tuple[bytes, int]:
    head = len(row_layout.CDR_HEADER)
    messages = breakup_chunk(chunk, validate_crc=True)
    rows = [one.data[head:] for one in messages if isinstance(one, Message)]
    return b"".join(rows), len(rows)


def _slice_rows(chunk: Chunk, stride: int) -> tuple[bytes, int]:
    stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    messages = np.frombuffer(stream.read(length), np.uint8).reshape(-1, stride)
    return messages[:, MESSAGE_BYTES:].tobytes(), len(messages)


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


KILLED = "its processes were killed"
LOOP_KILLED = "its loop was killed"
_OUTPUT_HINT = "use `rig recover RUN --output FILE` to write to another file"


class Recovery(NamedTuple):
    """Result of a recovery."""

    sources: tuple[Path, ...]  # files that the crash left; empty if the record was whole
    output: Path  # the finished record
    written: bool  # False: it existed already
    account: TickAccount
    duplicates: int  # duplicate rows removed; counted when the file is written
    unread: int  # bytes of the sources outside whole records
    damage: tuple[str, ...]
    read_back: ReadBack  # result of reading with the stock MCAP library
    outcome: str  # end of the run, as far as known

    @property
    def record(self) -> str:
        """The state of the record as text."""
        account = self.account
        if not account.lost and not self.damage:
            return "recovered" if self.complete else "recovered: rows may be missing at its end"
        final = account.end_report is not None and account.end_report.final
        count = f"{'' if final else 'at least '}{account.lost} of {account.rows + account.lost}"
        return f"recovered: {count} ticks missing"

    @property
    def complete(self) -> bool:
        """Whether nothing is lost, and this is certain."""
        return self.account.complete and not self.damage


def recover(run: Path, output: Path | None, now: datetime) -> Recovery:
    """Recover a run folder, or one MCAP file, and account for every tick of it.

    Write ``output``; by default ``run.mcap`` in the folder from its parts, or
    ``NAME.recovered.mcap`` next to a damaged file. The folder's status then states how the run
    ended. Raise BusyError while the run is being written, RunError if nothing in it is readable or
    another file has the output's name, OSError if the output cannot be written.
    """
    place = run if run.is_dir() else run.parent
    with create.lock_run(place):
        status = read_json(place / folder.STATUS) if run.is_dir() else {}
        progress = read_json(place / PROGRESS) if run.is_dir() else {}
        if status.get("status") == "running" and folder.is_supervised(status):
            raise create.BusyError(f"{run}: its supervisor, process {status['pid']}, still runs")
        sources, target = _sources_and_target(run)
        if output is not None and output.resolve() != target.resolve():
            sources, target = sources or (target,), output
        recovery = _recover_sources(sources, target, status, progress)
        if output is None and run.is_dir() and status:
            _update_status(run, status, recovery, now)
        return recovery


def _sources_and_target(run: Path) -> tuple[tuple[Path, ...], Path]:
    """Return the files to recover from and the target; no files if the target is whole."""
    if not run.is_dir():
        if _is_intact(run):
            return (), run
        return (run,), run.with_name(f"{run.name.removesuffix('.mcap')}.recovered.mcap")
    record = run / folder.MCAP
    if record.is_file():
        # A file of this name was finished once; if it is not now, disk or copy have damaged it.
        if _is_intact(record):
            return tuple(folder.mcap_parts(run)), record
        return (record, *folder.mcap_parts(run)), run / folder.RECOVERED
    parts = tuple(folder.mcap_parts(run))
    if not parts:
        raise RunError(f"{folder.no_record_text(run)}: nothing was written")
    return parts, record


def _is_intact(path: Path) -> bool:
    """Return whether a file is as its writer finished it, for us and the stock MCAP library."""
    try:
        found = mcap_file.scan(path)
        if not found.finished or found.damage:
            return False
        read_back(path, 8 * len(found.leaves))
    except RunError:
        return False
    return True


def _recover_sources(
    sources: tuple[Path, ...], target: Path, status: dict[str, Any], progress: dict[str, Any]
) -> Recovery:
    duplicates = unread = 0
    damage: list[str] = []
    written = not target.exists()
    if written:
        joined = join(sources, target)
        duplicates, unread, damage = joined.duplicates, joined.unread, list(joined.damage)
        contents = mcap_file.scan(target)
    else:
        contents = mcap_file.scan(target)
        if not contents.finished:
            raise RunError(f"{target} exists and is not a finished record: {_OUTPUT_HINT}")
        unread, damage = _compare_with_sources(sources, contents)
        damage += contents.damage
    report = end_report(status, progress, contents.attachments)
    account = account_ticks(mcap_file.blocks(contents, damage), report)
    verified = read_back(target, 8 * len(contents.leaves))
    if verified.rows != account.rows:
        raise RunError(f"{target}: read back {verified.rows} rows where {account.rows} are counted")
    reasons = folder.recorded_reasons(folder.parse_json(contents.attachments.get("plan.json")))
    outcome = _outcome(status, progress, contents, report, reasons)
    return Recovery(
        sources, target, written, account, duplicates, unread, tuple(damage), verified, outcome
    )


def _compare_with_sources(sources: tuple[Path, ...], done: FileContents) -> tuple[int, list[str]]:
    """Return unread bytes and damage of the sources; raise RunError if ``done`` is not of them."""
    parts, damage = mcap_file.scan_all(sources)
    ticks = set[int]()
    for part in parts:
        for block in mcap_file.blocks(part, damage):
            ticks.update(block["tick"][[0, -1]].tolist() if len(block) else ())
        if part.metadata.get("run") != done.metadata.get("run"):
            raise RunError(f"{done.path} exists and belongs to another run: {_OUTPUT_HINT}")
    found_ticks = set[int]()
    for block in mcap_file.blocks(done):
        found_ticks.update(ticks.intersection(block["tick"].tolist()))
    if found_ticks != ticks:
        raise RunError(f"{done.path} exists and lacks rows of {sources[0].parent}: {_OUTPUT_HINT}")
    return sum(part.unread for part in parts), damage


def _outcome(
    status: dict[str, Any],
    progress: dict[str, Any],
    contents: FileContents,
    report: EndReport | None,
    reasons: ReasonTable,
) -> str:
    last_status = (
        status
        if status.get("status") not in (None, "running")
        else logger_status(contents.attachments)
    )
    status_text = str(last_status.get("status") or "crashed")
    reason = str(last_status.get("reason") or KILLED)
    loop_reason = progress.get("reason")
    if not isinstance(loop_reason, int):  # loops before 2027 wrote its name
        loop_reason = reasons.number(str(loop_reason))
    if report is not None and report.source == LOOP and loop_reason is not None:
        return f"{create.end_status(loop_reason)}: {reasons.name(loop_reason)}"
    if (report is None or not report.final) and last_status is not status:
        return f"crashed: {KILLED}"
    return f"{status_text}: {LOOP_KILLED if reason == 'NONE' else reason}"


def _update_status(run: Path, status: dict[str, Any], recovery: Recovery, now: datetime) -> None:
    """Write into the run's status how it ended, where no process was left to do so."""
    if status.get("status") != "running" and (not recovery.sources or "recovered_utc" in status):
        return
    changed = {**status, "record": recovery.record}
    if status.get("status") == "running":
        status_text, _, reason = recovery.outcome.partition(": ")
        changed |= {"status": status_text, "reason": reason}
        if (report := recovery.account.end_report) is not None and report.final:
            changed |= {"ticks": report.ticks, "witness": report.source}
    create.write_json(run, folder.STATUS, changed | {"recovered_utc": now.isoformat()})
    (run / folder.SOCKET).unlink(missing_ok=True)  # of its dead supervisor
