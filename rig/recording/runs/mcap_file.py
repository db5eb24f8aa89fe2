"""The rows of a run's MCAP files as numpy records, each chunk by itself."""

import os
import struct
from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from heapq import merge
from io import BytesIO
from typing import Any

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Message
from mcap.stream_reader import StreamReader

from rig.recording import row_layout
from rig.recording.mcap_writer import MESSAGE_BYTES
from rig.recording.runs.mcap_records import RECORD, Chunk, RunError, plain, records_in
from rig.recording.runs.record_scan import Contents, scan
from rig.regular_file import open_regular

__all__ = [
    "HOPELESS",
    "Chunk",
    "Contents",
    "Records",
    "RunError",
    "blocks",
    "merged",
    "row_dtype",
    "scan",
    "utc_of_zero",
]

_HEAD = struct.Struct("<BQH")  # what all messages of a file have in common
HOPELESS = "no row can be read from it, by `rig recover` neither: only another copy helps"
_UNREADABLE = (McapError, struct.error, ValueError)  # a RunError is a ValueError
_AHEAD = 4  # chunks decompressed while one is being copied

Records = np.ndarray[tuple[int], np.dtype[Any]]


def row_dtype(leaves: tuple[row_layout.Leaf, ...], ahead: int = 0) -> np.dtype[Any]:
    """The packed numpy record of a row, fields by dotted path, ``ahead`` bytes before each row."""
    return np.dtype(
        {
            "names": [leaf.name for leaf in leaves],
            "formats": ["<f8" if leaf.code == "d" else "<i8" for leaf in leaves],
            "offsets": [ahead + 8 * i for i in range(len(leaves))],
            "itemsize": ahead + 8 * len(leaves),
        }
    )


def _rows(contents: Contents, dtype: np.dtype[Any], chunk: Chunk, data: bytes) -> Records:
    """The rows of a chunk; RunError if it is damaged."""
    try:
        return _rows_in(contents, dtype, plain(chunk, data))
    except RunError as error:
        raise RunError(f"{contents.path}: chunk at byte {chunk.offset}: {error}") from error


def _rows_in(contents: Contents, dtype: np.dtype[Any], data: bytes) -> Records:
    stride = contents.stride
    expected = _HEAD.pack(Opcode.MESSAGE, stride - RECORD.size, contents.channel)
    if len(data) % stride == 0:
        messages = np.frombuffer(data, np.uint8).reshape(-1, stride)
        if (messages[:, : _HEAD.size] == np.frombuffer(expected, np.uint8)).all():
            if dtype.itemsize == stride:
                return np.frombuffer(data, dtype)
            return np.ascontiguousarray(messages[:, MESSAGE_BYTES:]).view(dtype)[:, 0]
    # As another tool has rewritten it, with other messages between the rows.
    head, ahead = expected[RECORD.size :], MESSAGE_BYTES - RECORD.size
    rows = [
        _row(contents, message[ahead - len(row_layout.CDR_HEADER) :])
        for opcode, message in records_in(data)
        if opcode == Opcode.MESSAGE and message.startswith(head)
    ]
    return np.frombuffer(b"".join(rows), row_dtype(contents.leaves))


def _row(contents: Contents, data: bytes) -> bytes:
    if len(data) != 8 * len(contents.leaves) + 4 or data[:4] != row_layout.CDR_HEADER:
        raise RunError(f"{contents.path}: a row of another size or byte order")
    return data[4:]


def blocks(
    contents: Contents, damage: list[str] | None = None, *, packed: bool = True
) -> Iterator[Records]:
    """The rows in file order, one block a chunk, as records of `row_dtype`.

    A damaged chunk is left out, and named in ``damage`` if that is given. With ``packed`` False
    other bytes may lie between the rows: they are not copied, which is a quarter of the time for
    who only picks fields.
    """
    yield from merged([contents], damage, packed=packed)


def merged(
    parts: Sequence[Contents], damage: list[str] | None = None, *, packed: bool = True
) -> Iterator[Records]:
    """`blocks` of several files of one run, ordered by their first ticks.

    So a chunk that is damaged in one file comes in its place from another that overlaps it. The
    times in the heads of chunks have no check sum and order nothing.
    """
    with ThreadPoolExecutor(2) as pool:
        files = [_file_blocks(each, pool, damage, packed) for each in parts]
        yield from merge(*files, key=_first_tick)


def _first_tick(block: Records) -> int:
    return int(block["tick"][0])


def _file_blocks(
    contents: Contents, pool: ThreadPoolExecutor, damage: list[str] | None, packed: bool
) -> Iterator[Records]:
    """The blocks of one file that hold rows, some of them decompressed ahead of their turn."""
    dtype = row_dtype(contents.leaves, 0 if packed else MESSAGE_BYTES)
    waiting: deque[Future[Records]] = deque()

    def next_block() -> Iterator[Records]:
        try:
            block = waiting.popleft().result()
        except RunError as error:
            if damage is not None:
                damage.append(str(error))
        else:
            if len(block):
                yield block

    with open_regular(contents.path) as file:
        for chunk in contents.chunks:
            data = os.pread(file.fileno(), chunk.length, chunk.offset)
            waiting.append(pool.submit(_rows, contents, dtype, chunk, data))
            if len(waiting) > _AHEAD:
                yield from next_block()
        while waiting:
            yield from next_block()
    if contents.loose and not contents.chunks and len(rows := _stock_rows(contents, damage)):
        yield rows


def _stock_rows(contents: Contents, damage: list[str] | None) -> Records:
    """All rows by the stock reader, for a file that another tool wrote without chunks."""
    rows: list[bytes] = []
    try:
        for message in _stock_messages(contents):
            rows.append(_row(contents, message.data))
    except _UNREADABLE as error:  # where it is cut off
        if contents.finished and damage is not None:
            damage.append(f"{contents.path}: {error}")
    return np.frombuffer(b"".join(rows), row_dtype(contents.leaves))


def _stock_messages(contents: Contents) -> Iterator[Message]:
    with open_regular(contents.path) as file:
        for item in StreamReader(file).records:
            if isinstance(item, Message) and item.channel_id == contents.channel:
                yield item


def _chunk_messages(contents: Contents) -> Iterator[Message]:
    with open_regular(contents.path) as file:
        for chunk in contents.chunks:
            with suppress(*_UNREADABLE):
                data = plain(chunk, os.pread(file.fileno(), chunk.length, chunk.offset))
                for opcode, content in records_in(data):
                    if opcode == Opcode.MESSAGE:
                        message = Message.read(ReadDataStream(BytesIO(content)), len(content))
                        if message.channel_id == contents.channel:
                            yield message


def utc_of_zero(contents: Contents) -> int | None:
    """UTC of run time zero, ns since 1970, by the first readable row; None if there is none.

    Both its log time and its run time lie within the chunk's check sum.
    """
    messages = _chunk_messages if contents.chunks else _stock_messages
    with suppress(*_UNREADABLE):
        for message in messages(contents):
            row = np.frombuffer(_row(contents, message.data), row_dtype(contents.leaves))[0]
            return message.log_time - int(row["time"] * 1e9 + 0.5)
    return None
