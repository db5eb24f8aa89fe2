"""Records of an MCAP file; consistent lengths distinguish a record from arbitrary bytes."""

import os
import struct
import zlib
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import zstandard
from mcap.opcode import Opcode
from mcap.records import Chunk as McapChunk
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC

RECORD = struct.Struct("<BQ")
_FOOTER = struct.Struct("<BQQQI")
_SHORT, _LONG = struct.Struct("<I"), struct.Struct("<Q")
_MIN_MESSAGE_BYTES = 22  # message without data
_MAX_CHUNK_BYTES = 1 << 28  # decompressed; a larger size is a damaged length
_HEAD_BYTES = 64  # read at once: enough for the lengths in a chunk or message index
_SEARCH_BYTES = 1 << 20  # bytes searched at a time for the next whole record
# Parts of each kind of record: a number of bytes; S, a text or list after a length of 4 bytes;
# L, data after a length of 8 bytes.
_RECORD_PARTS: dict[int, tuple[Any, ...]] = {
    Opcode.HEADER: ("S", "S"),
    Opcode.SCHEMA: (2, "S", "S", "S"),
    Opcode.CHANNEL: (4, "S", "S", "S"),
    Opcode.CHUNK: (28, "S", "L"),
    Opcode.MESSAGE_INDEX: (2, "S"),
    Opcode.ATTACHMENT: (16, "S", "S", "L", 4),
    Opcode.METADATA: ("S", "S"),
    Opcode.DATA_END: (4,),
}
_RESYNC_OPCODES = [opcode for opcode in _RECORD_PARTS if opcode != Opcode.HEADER]


class RunError(ValueError):
    """A run cannot be read; the message names the file and the cause."""


class Chunk(NamedTuple):
    """Location of a chunk's compressed data."""

    offset: int  # of the data in the file, bytes
    length: int
    size: int  # decompressed size given in the chunk's head
    crc: int  # of the decompressed data; 0: none, as in our files (zstd frames have their own)
    compression: str


class RecordFile:
    """An open file of known length."""

    def __init__(self, fd: int, size: int) -> None:
        self.fd = fd
        self.size = size
        self._head = (0, b"")  # offset and bytes of the last short read

    def read(self, at: int, length: int) -> bytes:
        length = max(0, min(length, self.size - at))
        if length > _HEAD_BYTES:
            return os.pread(self.fd, length, at)
        begin, data = self._head
        if not begin <= at <= at + length <= begin + len(data):
            begin, data = self._head = at, os.pread(self.fd, _HEAD_BYTES, at)
        return data[at - begin : at - begin + length]

    def record(self, at: int) -> tuple[int, int, int] | None:
        """Return kind, start and length of the content of the record at ``at``; None if not whole.

        The content of a chunk may still be damaged; its check sum detects that.
        """
        head = self.read(at, RECORD.size)
        if len(head) < RECORD.size:
            return None
        opcode, length = RECORD.unpack(head)
        start = at + RECORD.size
        if start + length > self.size:
            return None
        if opcode == Opcode.MESSAGE:  # outside chunks only in files of other writers
            return (opcode, start, length) if length >= _MIN_MESSAGE_BYTES else None
        record_parts, offset = _RECORD_PARTS.get(opcode), start
        if record_parts is None:
            return None
        for part in record_parts:
            if part in ("S", "L"):
                length_field = _SHORT if part == "S" else _LONG
                prefix = self.read(offset, length_field.size)
                if len(prefix) < length_field.size:
                    return None
                offset += length_field.size + length_field.unpack(prefix)[0]
            else:
                offset += part
            if offset > start + length:
                return None
        return (opcode, start, length) if offset == start + length else None

    def next_record(self, start: int) -> int:
        """Return the offset of the next whole record at ``start`` or later, or the file size."""
        for at in range(start, self.size, _SEARCH_BYTES):
            block = np.frombuffer(self.read(at, _SEARCH_BYTES + RECORD.size - 1), np.uint8)
            count = len(block) - RECORD.size + 1
            if count <= 0:
                break
            candidates = np.isin(block[:count], _RESYNC_OPCODES)
            for high in (6, 7, 8):  # no record is a terabyte long
                candidates &= block[high : high + count] == 0
            for index in np.flatnonzero(candidates).tolist():
                record = self.record(at + index)
                if record and (
                    record[0] != Opcode.DATA_END or self.summary(at + index) is not None
                ):
                    return int(at + index)
        return self.size

    def summary(self, data_end: int) -> bytes | None:
        """Return the summary after a data end, if it is complete and its check sum is right."""
        begin, end = data_end + RECORD.size + 4, self.size - len(MCAP0_MAGIC)
        tail = self.read(begin, self.size - begin)
        if len(tail) < _FOOTER.size + len(MCAP0_MAGIC) or not tail.endswith(MCAP0_MAGIC):
            return None
        footer = tail[end - _FOOTER.size - begin : end - begin]
        opcode, length, summary_start, _, crc = _FOOTER.unpack(footer)
        if opcode != Opcode.FOOTER or length != 20 or summary_start not in (0, begin):
            return None
        if crc and zlib.crc32(tail[: end - begin - 4]) != crc:
            return None
        return tail[: end - begin - _FOOTER.size]


def records_in(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield kind and content of consecutive records; end at a cut-off record."""
    at = 0
    while at + RECORD.size <= len(data):
        opcode, length = RECORD.unpack_from(data, at)
        at += RECORD.size
        if at + length > len(data):
            return
        yield opcode, data[at : at + length]
        at += length


def decompress(chunk: Chunk, data: bytes) -> bytes:
    """Return a chunk's decompressed messages; raise RunError for a wrong check sum or length.

    The size in the chunk's head is not trusted: zstd's own frame is checked.
    """
    try:
        out = _decompressed(chunk, data)
    except (zstandard.ZstdError, RuntimeError, MemoryError) as error:
        raise RunError(str(error) or "its lengths are wrong") from error
    if chunk.crc and zlib.crc32(out) != chunk.crc:
        raise RunError("check sum differs")
    return out


def _decompressed(chunk: Chunk, data: bytes) -> bytes:
    if chunk.compression == "":
        return data
    if chunk.compression == "lz4":
        if chunk.size > _MAX_CHUNK_BYTES:
            raise RunError(f"{chunk.size} bytes are too many")
        lz4_chunk = McapChunk("lz4", data, 0, 0, chunk.crc, chunk.size)
        return get_chunk_data_stream(lz4_chunk)[0].read(chunk.size)
    # A damaged compression name must not cost the rows: other data fail as zstd anyway.
    size = zstandard.frame_content_size(data)
    size_limit = chunk.size if size < 0 else size
    if size_limit > _MAX_CHUNK_BYTES:
        raise RunError(f"{size_limit} bytes are too many")
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=size_limit)
