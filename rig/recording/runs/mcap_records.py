"""The records of an MCAP file, told from bytes that are none by the lengths inside them."""

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
_LEAST_MESSAGE = 22  # bytes, without data
_MOST_PLAIN = 1 << 28  # bytes of a decompressed chunk: more is a damaged length
_BLOCK = 1 << 20  # bytes looked through at a time for the next whole record
# What each kind of record is made of: a number of bytes, S a text or list with a length of 4
# bytes before it, L data with a length of 8 bytes.
_MADE_OF: dict[int, tuple[Any, ...]] = {
    Opcode.HEADER: ("S", "S"),
    Opcode.SCHEMA: (2, "S", "S", "S"),
    Opcode.CHANNEL: (4, "S", "S", "S"),
    Opcode.CHUNK: (28, "S", "L"),
    Opcode.MESSAGE_INDEX: (2, "S"),
    Opcode.ATTACHMENT: (16, "S", "S", "L", 4),
    Opcode.METADATA: ("S", "S"),
    Opcode.DATA_END: (4,),
}
_SEEN_FROM_AFAR = (
    Opcode.SCHEMA,
    Opcode.CHANNEL,
    Opcode.CHUNK,
    Opcode.MESSAGE_INDEX,
    Opcode.ATTACHMENT,
    Opcode.METADATA,
    Opcode.DATA_END,
)


class RunError(ValueError):
    """A run that cannot be read, with file and cause."""


class Chunk(NamedTuple):
    """Where a chunk's compressed data lies."""

    offset: int  # of the data, bytes
    length: int
    size: int  # decompressed, as its head says
    crc: int  # of the decompressed data; 0: not given, as in ours: zstd's frame has its own
    compression: str


class RecordFile:
    """An open file whose length is known."""

    def __init__(self, fd: int, size: int) -> None:
        self.fd = fd
        self.size = size

    def read(self, at: int, length: int) -> bytes:
        return os.pread(self.fd, max(0, min(length, self.size - at)), at)

    def record(self, at: int) -> tuple[int, int, int] | None:
        """Kind, start and length of the contents of the record at a place; None if none is whole.

        A chunk may be damaged inside; that its check sum tells.
        """
        head = self.read(at, RECORD.size)
        if len(head) < RECORD.size:
            return None
        opcode, length = RECORD.unpack(head)
        begin = at + RECORD.size
        if begin + length > self.size:
            return None
        if opcode == Opcode.MESSAGE:  # beside chunks only in files of other writers
            return (opcode, begin, length) if length >= _LEAST_MESSAGE else None
        made_of, place = _MADE_OF.get(opcode), begin
        if made_of is None:
            return None
        for part in made_of:
            if part in ("S", "L"):
                word = _SHORT if part == "S" else _LONG
                prefix = self.read(place, word.size)
                if len(prefix) < word.size:
                    return None
                place += word.size + word.unpack(prefix)[0]
            else:
                place += part
            if place > begin + length:
                return None
        return (opcode, begin, length) if place == begin + length else None

    def next_record(self, start: int) -> int:
        """Where the next whole record begins, at ``start`` or later; the file's end if nowhere."""
        for at in range(start, self.size, _BLOCK):
            block = np.frombuffer(self.read(at, _BLOCK + RECORD.size - 1), np.uint8)
            count = len(block) - RECORD.size + 1
            if count <= 0:
                break
            here = np.isin(block[:count], _SEEN_FROM_AFAR)
            for high in (6, 7, 8):  # a length of a terabyte or more is none
                here &= block[high : high + count] == 0
            for found in np.flatnonzero(here).tolist():
                seen = self.record(at + found)
                if seen and (seen[0] != Opcode.DATA_END or self.summary(at + found) is not None):
                    return int(at + found)
        return self.size

    def summary(self, data_end: int) -> bytes | None:
        """The summary behind a data end, if it is there to the file's end and its sum is right."""
        begin, end = data_end + RECORD.size + 4, self.size - len(MCAP0_MAGIC)
        tail = self.read(begin, self.size - begin)
        if len(tail) < _FOOTER.size + len(MCAP0_MAGIC) or not tail.endswith(MCAP0_MAGIC):
            return None
        footer = tail[end - _FOOTER.size - begin : end - begin]
        opcode, length, start, _, crc = _FOOTER.unpack(footer)
        if opcode != Opcode.FOOTER or length != 20 or start not in (0, begin):
            return None
        if crc and zlib.crc32(tail[: end - begin - 4]) != crc:
            return None
        return tail[: end - begin - _FOOTER.size]


def records_in(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Kind and contents of records that stand one behind the other; ends at one that is cut."""
    at = 0
    while at + RECORD.size <= len(data):
        opcode, length = RECORD.unpack_from(data, at)
        at += RECORD.size
        if at + length > len(data):
            return
        yield opcode, data[at : at + length]
        at += length


def plain(chunk: Chunk, data: bytes) -> bytes:
    """A chunk's messages, decompressed; RunError if their check sum, or any length, is wrong.

    The size that the chunk's head gives is not believed: zstd's own frame is checked.
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
        if chunk.size > _MOST_PLAIN:
            raise RunError(f"{chunk.size} bytes are too many")
        asked = McapChunk("lz4", data, 0, 0, chunk.crc, chunk.size)
        out: bytes = get_chunk_data_stream(asked)[0].read(chunk.size)
        return out
    # A damaged name is no reason to lose the rows: what is no zstd will not be taken for it.
    size = zstandard.frame_content_size(data)
    most = chunk.size if size < 0 else size
    if most > _MOST_PLAIN:
        raise RunError(f"{most} bytes are too many")
    return zstandard.ZstdDecompressor().decompress(data, max_output_size=most)
