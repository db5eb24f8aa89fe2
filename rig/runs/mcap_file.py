"""What lies where in a run's MCAP file, finished or not, and its rows as numpy records.

A file whose writer was killed has no summary, and the stock reader yields nothing from it; here
records are walked from the front, so finished and unfinished files are read alike.
"""

import os
import struct
import zlib
from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Message, Metadata, Schema
from mcap.stream_reader import StreamReader
from mcap.writer import MCAP0_MAGIC

from rig import record
from rig.log import MESSAGE_BYTES, TOPIC

_RECORD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")  # times, size, CRC, length of the compression's name
_HEAD = struct.Struct("<BQH")  # what all messages of a file have in common
_CHUNK_NAME = b"\x04\x00\x00\x00zstd"
_TO_NAME = _RECORD.size + _CHUNK.size - 4  # from a chunk's start to the length of that name
_BLOCK = 1 << 20  # bytes looked through at a time for the next whole chunk
_CUT = _TO_NAME + len(_CHUNK_NAME) - 1  # of them may lie in the block before
_AHEAD = 4  # chunks decompressed while one is being copied
_RENAMED = {"safety.warned": "heave.warned"}  # fields of runs that were recorded earlier

Records = np.ndarray[tuple[int], np.dtype[Any]]


class RunError(ValueError):
    """A run that cannot be read, with file and cause."""


class Chunk(NamedTuple):
    """Where a chunk's compressed data lies."""

    offset: int  # of the data, bytes
    length: int
    size: int  # decompressed
    crc: int  # of the decompressed data; 0: not given, as in ours: zstd's frame has its own
    compression: str


class Contents(NamedTuple):
    """A file's records, rows left where they are."""

    path: Path
    schema: str  # ros2msg text
    schema_name: str
    leaves: tuple[record.Leaf, ...]
    channel: int
    metadata: dict[str, dict[str, str]]
    attachments: dict[str, bytes]
    chunks: tuple[Chunk, ...]
    finished: bool  # the writer ended it
    unread: int  # bytes that are no whole record: a torn end, or damage
    damage: tuple[str, ...]  # what was skipped between whole records

    @property
    def stride(self) -> int:
        """Bytes of a message of our own layout."""
        return MESSAGE_BYTES + 8 * len(self.leaves)


def _resync(fd: int, start: int, size: int) -> int:
    """Offset of the next whole chunk at or after ``start``, or the file's end."""
    for at in range(start, size, _BLOCK):
        block = os.pread(fd, _BLOCK + _CUT, at)
        found = block.find(_CHUNK_NAME, _TO_NAME)
        while found >= 0:
            begin = found - _TO_NAME
            opcode, length = _RECORD.unpack_from(block, begin)
            if opcode == Opcode.CHUNK and at + begin + _RECORD.size + length <= size:
                return at + begin
            found = block.find(_CHUNK_NAME, found + 1)
    return size


class _Found:
    """What a walk has seen so far."""

    def __init__(self, file: BinaryIO) -> None:
        self.file = file
        self.schemas: dict[int, Schema] = {}
        self.channels: list[Channel] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self.attachments: dict[str, bytes] = {}
        self.chunks: list[Chunk] = []

    def take(self, opcode: int, at: int, length: int) -> None:
        if opcode == Opcode.CHUNK:
            self._chunk(at)
            return
        if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA, Opcode.ATTACHMENT):
            return
        stream = ReadDataStream(BytesIO(os.pread(self.file.fileno(), length, at)))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.schemas[schema.id] = schema
        elif opcode == Opcode.CHANNEL:
            self.channels.append(Channel.read(stream))
        elif opcode == Opcode.METADATA:
            metadata = Metadata.read(stream)
            self.metadata[metadata.name] = metadata.metadata
        else:
            attachment = Attachment.read(stream)
            self.attachments[attachment.name] = attachment.data

    def _chunk(self, at: int) -> None:
        head = os.pread(self.file.fileno(), _CHUNK.size + 64, at)
        _, _, size, crc, name_length = _CHUNK.unpack_from(head)
        data = _CHUNK.size + name_length + 8
        (length,) = struct.unpack_from("<Q", head, data - 8)
        name = head[_CHUNK.size : data - 8].decode()
        self.chunks.append(Chunk(at + data, length, size, crc, name))

    def look_inside(self) -> None:
        """Other writers put schema and channel into the first chunk: ask the stock reader."""
        self.file.seek(0)
        try:
            for item in StreamReader(self.file).records:
                if isinstance(item, Schema):
                    self.schemas[item.id] = item
                elif isinstance(item, Channel):
                    self.channels.append(item)
                elif isinstance(item, Message):
                    return
        except McapError:
            return


def _as_named_now(leaf: record.Leaf) -> record.Leaf:
    return leaf._replace(path=tuple(_RENAMED.get(leaf.name, leaf.name).split(".")))


def _row_channel(path: Path, found: _Found) -> tuple[Schema, Channel, tuple[record.Leaf, ...]]:
    """The channel of rows: the one named `TOPIC`, else the first whose schema can be laid out."""
    for channel in sorted(found.channels, key=lambda c: c.topic != TOPIC):
        schema = found.schemas.get(channel.schema_id)
        if schema is None or channel.message_encoding != "cdr" or schema.encoding != "ros2msg":
            continue
        try:
            leaves = record.leaves_of_schema(schema.data.decode())
            return schema, channel, tuple(_as_named_now(leaf) for leaf in leaves)
        except (record.RowError, KeyError):
            continue
    raise RunError(f"{path}: no channel of log rows in this file")


def scan(path: str | os.PathLike[str]) -> Contents:
    """Walk a file's records; damage between whole records is skipped and told.

    Raises RunError if the file is empty, not MCAP, or holds no description of log rows;
    FileNotFoundError if there is none.
    """
    path = Path(path)
    size = path.stat().st_size
    if size <= len(MCAP0_MAGIC):
        raise RunError(f"{path}: empty, nothing was written")
    damage: list[str] = []
    unread, finished, at = 0, False, len(MCAP0_MAGIC)
    # Read, not mapped: a mapping would bring 64 KiB into memory for each record looked at.
    with path.open("rb") as file:
        if os.pread(file.fileno(), len(MCAP0_MAGIC), 0) != MCAP0_MAGIC:
            raise RunError(f"{path}: not an MCAP file")
        found = _Found(file)
        while at + _RECORD.size <= size:
            opcode, length = _RECORD.unpack(os.pread(file.fileno(), _RECORD.size, at))
            after = at + _RECORD.size + length
            if not 1 <= opcode <= Opcode.DATA_END or after > size:
                after = _resync(file.fileno(), at + 1, size)
                unread += after - at
                if after < size:
                    damage.append(f"{path}: bytes {at} to {after} are not a record")
            elif opcode == Opcode.DATA_END:
                tail = os.pread(file.fileno(), len(MCAP0_MAGIC), size - len(MCAP0_MAGIC))
                finished = tail == MCAP0_MAGIC
                break
            else:
                found.take(opcode, at + _RECORD.size, length)
            at = after
        if not finished:
            unread += size - at
        if not found.channels:
            found.look_inside()
    schema, channel, leaves = _row_channel(path, found)
    return Contents(
        path,
        schema.data.decode(),
        schema.name,
        leaves,
        channel.id,
        found.metadata,
        found.attachments,
        tuple(found.chunks),
        finished,
        unread,
        tuple(damage),
    )


def row_dtype(leaves: tuple[record.Leaf, ...], ahead: int = 0) -> np.dtype[Any]:
    """The packed numpy record of a row, fields by dotted path, ``ahead`` bytes before each row."""
    return np.dtype(
        {
            "names": [leaf.name for leaf in leaves],
            "formats": ["<f8" if leaf.code == "d" else "<i8" for leaf in leaves],
            "offsets": [ahead + 8 * i for i in range(len(leaves))],
            "itemsize": ahead + 8 * len(leaves),
        }
    )


def is_ours(contents: Contents) -> bool:
    """Whether every chunk may hold nothing but rows of one size, as our writer leaves them."""
    stride = contents.stride
    return all(c.compression == "zstd" and c.size % stride == 0 for c in contents.chunks)


def _rows(contents: Contents, dtype: np.dtype[Any], chunk: Chunk, data: bytes) -> Records:
    """The rows of a chunk; RunError if it is damaged or holds anything else."""
    where = f"{contents.path}: chunk at byte {chunk.offset}"
    try:
        plain = zstandard.ZstdDecompressor().decompress(data, max_output_size=chunk.size)
    except zstandard.ZstdError as error:
        raise RunError(f"{where}: {error}") from error
    if chunk.crc and zlib.crc32(plain) != chunk.crc:
        raise RunError(f"{where}: check sum differs")
    messages = np.frombuffer(plain, np.uint8).reshape(-1, contents.stride)
    expected = _HEAD.pack(Opcode.MESSAGE, contents.stride - _RECORD.size, contents.channel)
    heads = messages[:, : _HEAD.size]
    if not (heads == np.frombuffer(expected, np.uint8)).all():
        raise RunError(f"{where}: messages of another kind between the rows")
    if dtype.itemsize == contents.stride:
        return np.frombuffer(plain, dtype)
    return np.ascontiguousarray(messages[:, MESSAGE_BYTES:]).view(dtype)[:, 0]


def blocks(
    contents: Contents, damage: list[str] | None = None, *, packed: bool = True
) -> Iterator[Records]:
    """The rows in file order, one block a chunk, as records of `row_dtype`.

    A damaged chunk raises RunError, or is skipped and told in ``damage`` if that is given. With
    ``packed`` False other bytes may lie between the rows: they are not copied, which is a quarter
    of the time for who only picks fields.
    """
    if not is_ours(contents):
        yield _stock_rows(contents)
        return
    dtype = row_dtype(contents.leaves, 0 if packed else MESSAGE_BYTES)
    waiting: deque[Future[Records]] = deque()

    def next_block() -> Iterator[Records]:
        try:
            yield waiting.popleft().result()
        except RunError as error:
            if damage is None:
                raise
            damage.append(str(error))

    with contents.path.open("rb") as file, ThreadPoolExecutor(2) as pool:
        for chunk in contents.chunks:
            data = os.pread(file.fileno(), chunk.length, chunk.offset)
            waiting.append(pool.submit(_rows, contents, dtype, chunk, data))
            if len(waiting) > _AHEAD:
                yield from next_block()
        while waiting:
            yield from next_block()


def _stock_rows(contents: Contents) -> Records:
    """All rows by the stock reader, for a file that another tool has rewritten."""
    size = 8 * len(contents.leaves)
    rows: list[bytes] = []
    with contents.path.open("rb") as file:
        try:
            for item in StreamReader(file).records:
                if isinstance(item, Message) and item.channel_id == contents.channel:
                    if len(item.data) != size + 4 or item.data[:4] != record.CDR_HEADER:
                        raise RunError(f"{contents.path}: a row of another size or byte order")
                    rows.append(item.data[4:])
        except (McapError, struct.error) as error:  # the latter inside a record that is cut off
            if contents.finished:
                raise RunError(f"{contents.path}: {error}") from error
    return np.frombuffer(b"".join(rows), row_dtype(contents.leaves))
