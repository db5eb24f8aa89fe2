"""A run's MCAP file: the scan of its records, and its rows as numpy records.

The file may be finished, cut off or damaged. A file whose writer was killed has no summary, and the
stock reader yields nothing from it; the scan visits the records from the front, so it reads
finished and unfinished files alike. A record is accepted only if the lengths inside it add up to
its own, so a flipped bit in a length costs that record and none after it; after an invalid record
the scan continues at the next valid one.
"""

import json
import os
import struct
import zlib
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from functools import cache
from heapq import merge
from importlib import resources
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from rig.recording.mcap_writer import (
    CHANNEL,
    CHECKSUM_KEY,
    MESSAGE_BYTES,
    SCHEMA_RECORD,
    TOPIC,
    metadata_checksum,
    schema_checksum,
)
from rig.recording.row_layout import CDR_HEADER, Leaf, RowError, RowSchema
from rig.recording.runs.mcap_records import (
    RECORD,
    Chunk,
    RecordFile,
    RunError,
    decompress,
    records_in,
)
from rig.regular_file import open_regular

UNREADABLE_HINT = "no row can be read, nor recovered by `rig recover`; use another copy"
_HEAD = struct.Struct("<BQH")  # start of a message record, the same for all rows of a file
_SHORT = struct.Struct("<I")
_UNREADABLE = (McapError, struct.error, ValueError, KeyError, EOFError)  # RunError: a ValueError
_PREFETCH_BLOCKS = 4  # blocks decompressed while one is being copied
_JOINED_CHUNKS = 8  # in a block of selected fields: work on a block costs more than on its rows

Records = np.ndarray[tuple[int], np.dtype[Any]]


class FileContents(NamedTuple):
    """A file's records; the rows remain in the file."""

    path: Path
    schema: RowSchema
    leaves: tuple[Leaf, ...]  # with the names of today
    channel: int
    metadata: dict[str, dict[str, str]]
    attachments: dict[str, bytes]
    chunks: tuple[Chunk, ...]
    finished: bool  # the writer finished it, and nothing of its end is missing or damaged
    unread: int  # bytes outside whole records: a cut-off end, or damage
    damage: tuple[str, ...]  # descriptions of skipped places and of damaged records
    has_loose_messages: bool  # messages outside chunks, as other writers may leave them

    @property
    def stride(self) -> int:
        """Bytes of a message of our own layout."""
        return MESSAGE_BYTES + 8 * len(self.leaves)


class _ScanResult:
    """Records found so far by a scan."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.schemas: list[Schema] = []
        self.channels: list[Channel] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self.attachments: dict[str, bytes] = {}
        self.chunks: list[Chunk] = []
        self.loose = False
        self.unsummed: list[str] = []  # metadata without a check sum, as in older files
        self.damage: list[str] = []
        self.indexed: list[Schema] = []  # schemas of a summary with a valid check sum

    def take(self, file: RecordFile, opcode: int, at: int, length: int) -> None:
        if opcode == Opcode.CHUNK:
            _, size, name_length = struct.unpack("<QQ4xI", file.read(at + 8, 24))
            crc = _SHORT.unpack(file.read(at + 24, 4))[0]
            data = at + 32 + name_length + 8
            name = file.read(at + 32, name_length).decode(errors="replace")
            self.chunks.append(Chunk(data, at + length - data, size, crc, name))
        elif opcode == Opcode.MESSAGE:
            self.loose = True
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA, Opcode.ATTACHMENT):
            try:
                self.describe(opcode, file.read(at, length))
            except _UNREADABLE:
                span = f"bytes {at - RECORD.size} to {at + length}"
                self.damage.append(f"{self.path}: {span} are damaged and left out")

    def describe(self, opcode: int, data: bytes) -> None:
        """Store a record other than a chunk; raise one of `_UNREADABLE` if it is damaged."""
        stream = ReadDataStream(BytesIO(data))
        if opcode == Opcode.SCHEMA:
            self.schemas.append(Schema.read(stream))
        elif opcode == Opcode.CHANNEL:
            self.channels.append(Channel.read(stream))
        elif opcode == Opcode.METADATA:
            metadata = Metadata.read(stream)
            check = metadata.metadata.pop(CHECKSUM_KEY, None)
            has_checksum = check == metadata_checksum(metadata.name, metadata.metadata)
            if not has_checksum and (check is not None or metadata.name == SCHEMA_RECORD):
                raise ValueError(metadata.name)
            if not has_checksum:
                self.unsummed.append(metadata.name)
            self.metadata[metadata.name] = metadata.metadata
        elif opcode == Opcode.ATTACHMENT:
            crc = _SHORT.unpack_from(data, len(data) - 4)[0]
            if crc and zlib.crc32(data[:-4]) != crc:
                raise ValueError("check sum")
            attachment = Attachment.read(stream)
            self.attachments[attachment.name] = attachment.data

    def index(self, summary: bytes) -> None:
        """Store schemas and channels of a summary."""
        for opcode, data in records_in(summary):
            if opcode == Opcode.SCHEMA:
                self.indexed.append(Schema.read(ReadDataStream(BytesIO(data))))
            elif opcode == Opcode.CHANNEL:
                self.channels.append(Channel.read(ReadDataStream(BytesIO(data))))

    def schema_of(self, channel: Channel) -> Schema | None:
        """Return the original schema of a channel from several copies; None if ambiguous."""
        every = (*self.schemas, *self.indexed)
        copies = [s for s in every if s.id == channel.schema_id and s.encoding == "ros2msg"]
        written = self.metadata.get(SCHEMA_RECORD, {}).get("sum")
        if written is not None and channel == CHANNEL:
            texts = [(each, each.data.decode(errors="replace")) for each in copies]
            good = (each for each, text in texts if schema_checksum(each.name, text) == written)
            return next(good, None)
        counts = Counter((s.name, s.data) for s in copies)
        if len(counts) > 1 and max(counts.values()) == 1:  # no two agree
            return next((s for s in copies if s in self.indexed), None)
        return max(copies, key=lambda s: counts[s.name, s.data], default=None)


@cache
def _earlier_fields() -> dict[str, dict[str, str]]:
    """Return today's names of fields of earlier runs, by row type and earlier name."""
    text = resources.files(__package__).joinpath("earlier_fields.json").read_text()
    renamed: dict[str, dict[str, str]] = json.loads(text)
    return renamed


def _current_leaves(schema: RowSchema) -> tuple[Leaf, ...]:
    renamed = _earlier_fields().get(schema.name, {})
    return tuple(
        leaf._replace(path=tuple(renamed.get(leaf.name, leaf.name).split(".")))
        for leaf in schema.leaves
    )


def _row_channel(found: _ScanResult) -> tuple[RowSchema, tuple[Leaf, ...], int]:
    """Return schema, leaves and number of the channel of rows.

    It is ours, else one named `TOPIC`, else one with a valid schema.
    """
    for channel in sorted(found.channels, key=lambda c: (c != CHANNEL, c.topic != TOPIC)):
        if channel.message_encoding != "cdr":
            continue
        try:
            record = found.schema_of(channel)
            if record is None:
                continue
            schema = RowSchema(record.name, record.data.decode())
            return schema, _current_leaves(schema), channel.id
        except (RowError, KeyError, ValueError):
            continue
    raise RunError(f"{found.path}: no channel of log rows in this file")


def scan(path: str | os.PathLike[str]) -> FileContents:
    """Scan a file's records; damage between whole records is skipped and reported.

    Raise RunError if the file is empty, not MCAP, or has no description of log rows;
    FileNotFoundError if it does not exist.
    """
    path = Path(path)
    with open_regular(path) as opened:
        file = RecordFile(opened.fileno(), os.fstat(opened.fileno()).st_size)
        if file.size <= len(MCAP0_MAGIC):
            raise RunError(f"{path}: empty, nothing was written")
        found = _ScanResult(path)
        magic = file.read(0, len(MCAP0_MAGIC)) == MCAP0_MAGIC
        finished, unread = _scan_records(file, found)
        if not found.channels:
            _describe_from_chunks(file, found)
        if not (magic or found.channels):
            raise RunError(f"{path}: not an MCAP file")
    if not magic:
        found.damage.insert(0, f"{path}: its first bytes are not those of an MCAP file")
    schema, leaves, channel = _row_channel(found)
    if found.metadata.pop(SCHEMA_RECORD, None) is not None:
        for name in found.unsummed:
            found.damage.append(f"{path}: metadata {name!r} is damaged and left out")
            found.metadata.pop(name, None)
    return FileContents(
        path,
        schema,
        leaves,
        channel,
        found.metadata,
        found.attachments,
        tuple(found.chunks),
        finished,
        unread,
        tuple(found.damage),
        found.loose,
    )


def scan_all(paths: Iterable[str | os.PathLike[str]]) -> tuple[list[FileContents], list[str]]:
    """Scan several files; return the readable ones, and a description of every damage."""
    contents: list[FileContents] = []
    damage: list[str] = []
    for path in paths:
        try:
            contents.append(scan(path))
        except RunError as error:
            damage.append(str(error))
        else:
            damage += contents[-1].damage
    return contents, damage


def merge_descriptions(
    contents: Iterable[FileContents],
) -> tuple[dict[str, bytes], dict[str, dict[str, str]]]:
    """Return the attachments and the metadata of a run's files.

    Of attachments the latest of a name counts; of metadata, such as the UTC of run time zero, the
    first.
    """
    attachments: dict[str, bytes] = {}
    metadata: dict[str, dict[str, str]] = {}
    for each in contents:
        attachments |= each.attachments
        metadata = each.metadata | metadata
    return attachments, metadata


def _scan_records(file: RecordFile, found: _ScanResult) -> tuple[bool, int]:
    """Store every record; return whether the file's end is whole, and the bytes left out."""
    at, unread = len(MCAP0_MAGIC), 0
    following = file.record(at)
    while at < file.size:
        record = following
        if record is not None and record[0] == Opcode.DATA_END:
            summary = file.summary(at)
            if summary is None:
                found.damage.append(f"{found.path}: its index, from byte {at} on, is damaged")
                return False, unread + file.size - at
            found.index(summary)
            return True, unread
        after = file.size if record is None else record[1] + record[2]
        following = file.record(after) if after < file.size else None
        if record is None or (after < file.size and following is None):
            next_start = file.next_record(at + 1)
            if record is None or next_start < after:  # no record, or shorter than its head states
                unread += next_start - at
                if next_start < file.size:
                    text = f"{found.path}: bytes {at} to {next_start} are not a record"
                    found.damage.append(text)
                at, following = next_start, file.record(next_start)
                continue
        found.take(file, *record)
        at = after
    return False, unread


def _describe_from_chunks(file: RecordFile, found: _ScanResult) -> None:
    """Read schema and channel from the first chunk, where other writers put them."""
    for chunk in found.chunks:
        try:
            content = decompress(chunk, file.read(chunk.offset, chunk.length))
        except RunError:
            continue
        for opcode, data in records_in(content):
            if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                with suppress(*_UNREADABLE):
                    found.describe(opcode, data)
        if found.channels:
            return


def row_dtype(leaves: tuple[Leaf, ...], prefix_bytes: int = 0) -> np.dtype[Any]:
    """Return the packed record dtype of a row, after ``prefix_bytes`` of other data.

    The fields have their dotted paths as names.
    """
    return np.dtype(
        {
            "names": [leaf.name for leaf in leaves],
            "formats": ["<f8" if leaf.code == "d" else "<i8" for leaf in leaves],
            "offsets": [prefix_bytes + 8 * i for i in range(len(leaves))],
            "itemsize": prefix_bytes + 8 * len(leaves),
        }
    )


class _Layout(NamedTuple):
    """Layout of the rows that a reader returns."""

    rows: np.dtype[Any]  # all fields; perhaps with other bytes between the rows
    columns: Sequence[int] = ()  # selected fields; none: all
    selected: np.dtype[Any] | None = None

    def select(self, rows: Records) -> Records:
        """Return the selected fields, packed; the rows as they are if none are selected.

        All numbers have 8 bytes, so they are copied at once, in a third of the time of single
        fields.
        """
        if self.selected is None:
            return rows
        if not len(rows):
            return np.empty(0, self.selected)
        names = rows.dtype.names or ()
        offset = rows.dtype.fields[names[0]][1] if rows.dtype.fields else 0
        shape, strides = (len(rows), len(names)), (rows.dtype.itemsize, 8)
        numbers = np.ndarray(shape, "<i8", rows.data, offset, strides)
        return numbers.take(self.columns, axis=1).view(self.selected)[:, 0]


def _layout(leaves: tuple[Leaf, ...], fields: Sequence[str] | None, packed: bool) -> _Layout:
    if fields is None:
        return _Layout(row_dtype(leaves, 0 if packed else MESSAGE_BYTES))
    columns = [i for i, leaf in enumerate(leaves) if leaf.name in fields]
    selected = row_dtype(tuple(leaves[i] for i in columns))
    return _Layout(row_dtype(leaves, MESSAGE_BYTES), columns, selected)


def join_records(parts: Sequence[Records]) -> Records:
    """Return packed records of one dtype in one array, at the speed of a copy.

    `numpy.concatenate` first compares every field of every part.
    """
    if len(parts) == 1:
        return parts[0]
    dtype = parts[0].dtype
    return np.concatenate([part.view(f"V{dtype.itemsize}") for part in parts]).view(dtype)


def _rows(
    contents: FileContents, layout: _Layout, chunks: Sequence[tuple[Chunk, bytes]]
) -> tuple[Records | None, list[str]]:
    """Return the rows of chunks in one array, and descriptions of those that are damaged."""
    found, damage = [], []
    for chunk, data in chunks:
        try:
            rows = layout.select(_rows_in(contents, layout.rows, decompress(chunk, data)))
        except RunError as error:
            damage.append(f"{contents.path}: chunk at byte {chunk.offset}: {error}")
        else:
            found.append(rows)
    return (join_records(found) if found else None), damage


def _rows_in(contents: FileContents, dtype: np.dtype[Any], data: bytes) -> Records:
    stride = contents.stride
    expected = _HEAD.pack(Opcode.MESSAGE, stride - RECORD.size, contents.channel)
    if len(data) % stride == 0:
        messages = np.frombuffer(data, np.uint8).reshape(-1, stride)
        if (messages[:, : _HEAD.size] == np.frombuffer(expected, np.uint8)).all():
            if dtype.itemsize == stride:
                return np.frombuffer(data, dtype)
            return np.ascontiguousarray(messages[:, MESSAGE_BYTES:]).view(dtype)[:, 0]
    # Another tool has rewritten the chunk, with other messages between the rows.
    head, ahead = expected[RECORD.size :], MESSAGE_BYTES - RECORD.size
    rows = [
        _row(contents, message[ahead - len(CDR_HEADER) :])
        for opcode, message in records_in(data)
        if opcode == Opcode.MESSAGE and message.startswith(head)
    ]
    return np.frombuffer(b"".join(rows), row_dtype(contents.leaves))


def _row(contents: FileContents, data: bytes) -> bytes:
    if len(data) != 8 * len(contents.leaves) + 4 or data[:4] != CDR_HEADER:
        raise RunError(f"{contents.path}: a row of another size or byte order")
    return data[4:]


def blocks(contents: FileContents, damage: list[str] | None = None) -> Iterator[Records]:
    """Yield the rows in file order, one block per chunk, as records of `row_dtype`.

    A damaged chunk is left out, and its description is added to ``damage`` if given.
    """
    return merged_blocks([contents], damage)


def merged_blocks(
    parts: Sequence[FileContents],
    damage: list[str] | None = None,
    *,
    packed: bool = True,
    fields: Sequence[str] | None = None,
) -> Iterator[Records]:
    """Yield the `blocks` of several files of one run, ordered by their first ticks.

    A chunk that is damaged in one file is thus replaced by that of an overlapping file. Chunks are
    not ordered by the times in their heads, because these have no check sum. With ``fields``, of
    which one is the tick, the blocks have these alone, packed, in storage order. With ``packed``
    False the blocks are views with other bytes between the rows: avoiding the copy saves three
    quarters of the time for a caller that only selects fields.
    """
    # Views of several chunks are not joined without a copy, and files are merged chunk by chunk.
    count = _JOINED_CHUNKS if fields is not None and len(parts) == 1 else 1
    with ThreadPoolExecutor(2) as pool:
        files = [
            _file_blocks(each, pool, damage, _layout(each.leaves, fields, packed), count)
            for each in parts
        ]
        yield from merge(*files, key=lambda block: int(block["tick"][0]))


def unrepeated(blocks: Iterable[Records]) -> Iterator[Records]:
    """Yield the rows of the blocks, each tick once: those above every tick before them.

    A tick repeats where files overlap, and within a file whose logger read the ring again.
    """
    last = -1
    for block in blocks:
        ticks, fresh = block["tick"], block
        if ticks[0] <= last or (ticks[1:] <= ticks[:-1]).any():
            before = np.maximum.accumulate(np.concatenate(([last], ticks)))[:-1]
            fresh = block[ticks > before]
        if len(fresh):
            last = int(fresh["tick"][-1])
            yield fresh


def _file_blocks(
    contents: FileContents,
    pool: ThreadPoolExecutor,
    damage: list[str] | None,
    layout: _Layout,
    count: int,
) -> Iterator[Records]:
    """Yield the non-empty blocks of one file, each of ``count`` chunks; some are decompressed in
    advance.
    """
    waiting: deque[Future[tuple[Records | None, list[str]]]] = deque()

    def next_block() -> Iterator[Records]:
        block, damaged = waiting.popleft().result()
        if damage is not None:
            damage.extend(damaged)
        if block is not None and len(block):
            yield block

    with open_regular(contents.path) as file:
        for first in range(0, len(contents.chunks), count):
            chunks = [
                (chunk, os.pread(file.fileno(), chunk.length, chunk.offset))
                for chunk in contents.chunks[first : first + count]
            ]
            waiting.append(pool.submit(_rows, contents, layout, chunks))
            if len(waiting) > _PREFETCH_BLOCKS:
                yield from next_block()
        while waiting:
            yield from next_block()
    if (
        contents.has_loose_messages
        and not contents.chunks
        and len(rows := _stock_rows(contents, damage))
    ):
        yield layout.select(rows)


def _stock_rows(contents: FileContents, damage: list[str] | None) -> Records:
    """Read all rows with the stock reader, for a file that another tool wrote without chunks."""
    rows: list[bytes] = []
    try:
        for message in _stock_messages(contents):
            rows.append(_row(contents, message.data))
    except _UNREADABLE as error:  # end of a cut-off file
        if contents.finished and damage is not None:
            damage.append(f"{contents.path}: {error}")
    return np.frombuffer(b"".join(rows), row_dtype(contents.leaves))


def _stock_messages(contents: FileContents) -> Iterator[Message]:
    with open_regular(contents.path) as file:
        for item in StreamReader(file).records:
            if isinstance(item, Message) and item.channel_id == contents.channel:
                yield item


def _chunk_messages(contents: FileContents) -> Iterator[Message]:
    with open_regular(contents.path) as file:
        for chunk in contents.chunks:
            with suppress(*_UNREADABLE):
                data = decompress(chunk, os.pread(file.fileno(), chunk.length, chunk.offset))
                for opcode, content in records_in(data):
                    if opcode == Opcode.MESSAGE:
                        message = Message.read(ReadDataStream(BytesIO(content)), len(content))
                        if message.channel_id == contents.channel:
                            yield message


def utc_of_zero(contents: FileContents) -> int | None:
    """Return the UTC of run time zero (ns since 1970) from the first readable row, or None.

    The log time and the run time of the row are both protected by the chunk's check sum.
    """
    messages = _chunk_messages if contents.chunks else _stock_messages
    with suppress(*_UNREADABLE):
        for message in messages(contents):
            row = np.frombuffer(_row(contents, message.data), row_dtype(contents.leaves))[0]
            return message.log_time - int(row["time"] * 1e9 + 0.5)
    return None
