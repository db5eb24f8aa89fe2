"""Reading a record with the stock MCAP library: the judge of what other tools will see.

The library takes 20 us a message, ten minutes for a day's record. So it finds, decompresses and
checks every chunk through the file's own index, and takes apart message by message those at both
ends and some in between; of the others the rows are cut out at the places where messages have them.
"""

import os
import struct
import zlib
from pathlib import Path
from typing import NamedTuple

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Chunk, Message
from mcap.stream_reader import breakup_chunk, get_chunk_data_stream

from rig.recording import row_layout
from rig.recording.mcap_writer import MESSAGE_BYTES
from rig.recording.runs.mcap_file import RunError
from rig.regular_file import open_regular

PARSED = 100_000  # messages taken apart one by one, about
_REFUSED = (
    *(McapError, zstandard.ZstdError, struct.error, ValueError, EOFError),
    *(KeyError, MemoryError, RuntimeError, OverflowError),
)
_HEAD = 9  # bytes of opcode and length before a chunk


class Seen(NamedTuple):
    """What the stock library finds of the rows."""

    rows: int
    crc: int  # CRC-32 of their packed bytes, one after the other in file order
    parsed: int  # of them, how many were taken apart message by message
    chunks: int  # whose check sum was right


def read_back(path: str | os.PathLike[str], row_size: int, most: int = PARSED) -> Seen:
    """Read every row, of ``row_size`` bytes, of a finished file that holds nothing but rows.

    ``most``: about how many messages are taken apart one by one. RunError if the library refuses
    the file, or the file's own statistics count other than its rows.
    """
    rows = crc = parsed = 0
    stride = MESSAGE_BYTES + row_size
    try:
        with open_regular(Path(path)) as file:
            summary = make_reader(file, validate_crcs=True).get_summary()
            if summary is None or summary.statistics is None:
                raise RunError(f"{path}: the mcap library finds no summary in it")
            indexes = summary.chunk_indexes
            every = max(1, -(-summary.statistics.message_count // max(1, most)))
            for number, index in enumerate(indexes):
                file.seek(index.chunk_start_offset + _HEAD)
                chunk = Chunk.read(ReadDataStream(file))
                if number % every == 0 or number == len(indexes) - 1:
                    data, count = _taken_apart(chunk)
                    parsed += count
                else:
                    data, count = _cut_out(chunk, stride)
                crc = zlib.crc32(data, crc)
                rows += count
    except RunError:
        raise
    except _REFUSED as error:
        raise RunError(f"{path}: the mcap library refuses it: {error!r}") from error
    if summary.statistics.message_count != rows:
        raise RunError(f"{path}: its statistics do not count its rows")
    return Seen(rows, crc, parsed, len(indexes))


def _taken_apart(chunk: Chunk) -> tuple[bytes, int]:
    head = len(row_layout.CDR_HEADER)
    found = breakup_chunk(chunk, validate_crc=True)
    rows = [one.data[head:] for one in found if isinstance(one, Message)]
    return b"".join(rows), len(rows)


def _cut_out(chunk: Chunk, stride: int) -> tuple[bytes, int]:
    stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    messages = np.frombuffer(stream.read(length), np.uint8).reshape(-1, stride)
    return messages[:, MESSAGE_BYTES:].tobytes(), len(messages)
