"""Verification of a record with the stock MCAP library, as other tools will read it.

The library takes 20 us a message, ten minutes for a day's record. Therefore it finds, decompresses
and checks every chunk through the file's own index, but parses message by message only the
first and last chunk and some in between; of the others it slices the rows at their known places.
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
from rig.recording.runs.mcap_records import RunError
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


def read_back(
    path: str | os.PathLike[str], row_size: int, max_parsed: int = MAX_PARSED
) -> ReadBack:
    """Read every row of ``row_size`` bytes of a finished file that holds nothing but rows.

    ``max_parsed``: approximate number of messages parsed one by one. Raise RunError if the library
    rejects the file, or the file's own statistics disagree with its rows.
    """
    rows = crc = parsed = 0
    stride = MESSAGE_BYTES + row_size
    try:
        with open_regular(Path(path)) as file:
            summary = make_reader(file, validate_crcs=True).get_summary()
            if summary is None or summary.statistics is None:
                raise RunError(f"{path}: the mcap library finds no summary in it")
            indexes = summary.chunk_indexes
            stride_of_parsed = max(1, -(-summary.statistics.message_count // max(1, max_parsed)))
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
