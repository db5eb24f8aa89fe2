"""Writer of packed log rows into one MCAP file that other tools can open.

Rows arrive as the bytes that the loop wrote and are stored as ROS 2 messages (4 header bytes and
the row); only tick and time are decoded on the way. Records are built in memory and written at
known offsets: a record is either wholly in the file or will be written again in the same place, so
a full disk costs no row and leaves no partial record between whole ones. A file whose writer was
killed holds every record up to the last `RowWriter.flush` and lacks only its index
(`rig.recording.runs.recover` restores it).

MCAP has check sums for chunks, attachments and the summary, but none for a schema, a channel or a
metadata record; a flipped bit in one of those would change a field, a unit or the start time. So
our files carry their own.

Chunks are built here, as arrays of messages: single messages through ``mcap.writer.Writer`` cost
8 us a row, arrays 0.1 us. A thread compresses full chunks while the next rows are taken. The
library's own classes write all other records.
"""

import os
import struct
import zlib
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from rig.recording.row_layout import CDR_HEADER, Leaf, RowError, RowSchema

TOPIC = "/row"
CLOCK_RECORD = "clock"  # metadata record with the mapping from run time to UTC
START_KEY = "start_utc_ns"
SCHEMA_RECORD = "form"  # metadata record with the check sum of the schema, which itself has none
CHECKSUM_KEY = "crc32"  # key in a metadata record: check sum of its other pairs
SCHEMA_ID = CHANNEL_ID = 1
CHANNEL = records.Channel(CHANNEL_ID, TOPIC, "cdr", {}, SCHEMA_ID)  # the only one of a file
# Measured: chunks of 128 KiB to 1 MiB are equally fast, smaller ones compress worse and take longer
# to find in a file.
CHUNK_BYTES = 512 * 1024
# zstd's level -1 with a hash table that stays in the processor's first cache, no search for matches
# shorter than a number, and none farther back than half the second cache: 15 % faster for 1 % of
# size. Level 1 takes 1.4 times as long for 2 % less, level 3 2.3 times for 5 % less; lz4 the same
# time for 25 % more.
COMPRESSION = zstandard.ZstdCompressionParameters(
    strategy=zstandard.STRATEGY_FAST, target_length=1, min_match=7, hash_log=13, chain_log=6,
    search_log=1, window_log=18, write_checksum=True,
)  # fmt: skip
_BUFFERS = 3  # chunks in memory: one is filled, one compressed, one waits
_NO_CRC = 0  # zstd's own check sum is faster, and every decoder checks it
_MESSAGE = [  # record head, message head, CDR header; the row follows
    ("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("sequence", "<u4"),
    ("log_time", "<u8"), ("publish_time", "<u8"), ("cdr", "V4"),
]  # fmt: skip
MESSAGE_BYTES = np.dtype(_MESSAGE).itemsize
_INDEX = np.dtype([("time", "<u8"), ("offset", "<u8")])
_INDEX_HEAD = struct.Struct("<BQHI")
# Opcode, length, start and end time, uncompressed size, CRC, compression, length of the data.
_CHUNK_HEAD = struct.Struct("<BQQQQII4sQ")

_Entry = records.ChunkIndex | records.AttachmentIndex | records.MetadataIndex


class _Encoded(NamedTuple):
    """Whole records as they go into the file, and the entry of the summary that locates them.

    The entry's offsets are those from the begin of the records, until they are written.
    """

    data: bytes
    entry: _Entry | None = None
    rows: int = 0


def schema_checksum(name: str, text: str) -> str:
    """Return the check sum of a schema."""
    return f"{zlib.crc32(repr((name, text)).encode()):08x}"


def metadata_checksum(name: str, pairs: dict[str, str]) -> str:
    """Return the check sum of a metadata record."""
    return f"{zlib.crc32(repr((name, sorted(pairs.items()))).encode()):08x}"


def _time_index(leaves: tuple[Leaf, ...]) -> int:
    """Return the index of the time (s) among the numbers of a row; the tick has index 0."""
    fields = [(leaf.name, leaf.code) for leaf in leaves]
    if fields[0] != ("tick", "q"):
        raise RowError(f"the first field of a row is its tick, not {fields[0][0]}")
    if ("time", "d") not in fields:
        raise RowError("a row needs a field time in seconds")
    return fields.index(("time", "d"))


def _serialise(*parts: records.McapRecord) -> bytes:
    builder = RecordBuilder()
    for part in parts:
        part.write(builder)
    end: Callable[[], bytes] = builder.end
    return end()


class RowWriter:
    """Writes a run's MCAP file; for use by one thread.

    `append` takes rows into memory and never touches the disk. `flush` and `finish` do: after an
    OSError (disk full, device gone) nothing is lost, and either may be called again.
    """

    def __init__(
        self,
        path: str | os.PathLike[str],
        schema: RowSchema,
        attachments: dict[str, bytes],
        metadata: dict[str, dict[str, str]],
        *,
        start_utc_ns: int,
    ) -> None:
        """Create the file (it must not exist) with its schema, metadata and attachments.

        ``start_utc_ns``: UTC of run time zero in nanoseconds since 1970. Raises FileExistsError,
        RowError, or OSError when the head of the file cannot be written.
        """
        self.path = Path(path)
        leaves = schema.leaves
        self._time = _time_index(leaves)
        self._size = 8 * len(leaves)
        self._stride = MESSAGE_BYTES + self._size
        message = np.dtype([*_MESSAGE, ("row", f"V{self._size}")])
        capacity = max(1, CHUNK_BYTES // self._stride)
        self._buffers = [np.zeros(capacity, message) for _ in range(_BUFFERS)]
        for buffer in self._buffers:  # the fields that all messages share are set once
            buffer["opcode"], buffer["length"] = Opcode.MESSAGE, self._stride - 9
            buffer["channel"], buffer["cdr"] = CHANNEL_ID, np.void(CDR_HEADER)
        self._open = self._buffers[0]  # the open chunk
        self._filled = 0  # messages in it
        self._index_entries = np.zeros(capacity, _INDEX)  # of a full chunk, without times
        self._index_entries["offset"] = np.arange(capacity) * self._stride
        self._start = start_utc_ns
        self._latest = start_utc_ns
        self._compressor = zstandard.ZstdCompressor(compression_params=COMPRESSION)
        self._thread = ThreadPoolExecutor(1)  # releases the interpreter while it compresses
        self._compressing: deque[Future[_Encoded]] = deque()  # each has one of the buffers
        self._waiting: deque[_Encoded | Future[_Encoded]] = deque()  # not in the file yet
        self._chunks: list[records.ChunkIndex] = []
        self._attachments: list[records.AttachmentIndex] = []
        self._metadata: list[records.MetadataIndex] = []
        self._taken = 0  # rows of ended chunks
        self._rows = 0  # rows in the file
        self.committed = 0
        self._schema = records.Schema(SCHEMA_ID, schema.text.encode(), "ros2msg", schema.name)
        self.descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o644)
        self._closed = False
        # Written twice, as the standard allows: a schema has no check sum, and rows need it.
        descriptions = (self._schema, CHANNEL) * 2
        head = _serialise(records.Header("ros2", "wec-rig"), *descriptions)
        self._waiting.append(_Encoded(MCAP0_MAGIC + head))
        encoded = {
            SCHEMA_RECORD: {"sum": schema_checksum(*schema)},
            CLOCK_RECORD: {START_KEY: str(start_utc_ns)},
        }
        for name, pairs in {**metadata, **encoded}.items():
            self._queue_metadata(name, pairs)
        for name, data in attachments.items():
            self.attach(name, data)
        try:
            self.flush()
        except OSError:
            self.close()
            self.path.unlink()
            raise

    @property
    def pending(self) -> int:
        """Bytes of rows held in memory: the loss if the process were killed now."""
        return (self.rows - self._rows) * self._stride

    @property
    def rows(self) -> int:
        """Rows taken so far."""
        return self._taken + self._filled

    def append(self, rows: bytes | bytearray | memoryview) -> None:
        """Take n whole packed rows (copied); raise ValueError, taking none, if they are not."""
        if len(rows) % self._size:
            raise ValueError(f"{len(rows)} bytes are not whole rows of {self._size} bytes")
        numbers = np.frombuffer(rows, "<f8").reshape(-1, self._size // 8)
        seconds = numbers[:, self._time]
        if not np.isfinite(seconds).all():
            raise ValueError("a row's time is not a finite number")
        ticks = numbers.view("<i8")[:, 0].astype(np.uint32)  # the low half of the tick
        times = (seconds * 1e9 + 0.5).astype(np.int64) + self._start
        packed = np.frombuffer(rows, f"V{self._size}")
        done = 0
        while done < len(packed):
            count = min(len(packed) - done, len(self._open) - self._filled)
            into, some = self._open[self._filled : self._filled + count], slice(done, done + count)
            into["sequence"], into["row"] = ticks[some], packed[some]
            into["log_time"] = into["publish_time"] = times[some]
            self._filled, done = self._filled + count, done + count
            if self._filled == len(self._open):
                self._end_chunk()

    def attach(self, name: str, data: bytes) -> None:
        """Queue an attachment; of several with the same name the last one counts."""
        media = "application/json" if name.endswith(".json") else "application/octet-stream"
        encoded = _serialise(records.Attachment(self._latest, self._latest, name, media, data))
        index = records.AttachmentIndex(
            create_time=self._latest,
            data_size=len(data),
            length=len(encoded),
            log_time=self._latest,
            media_type=media,
            name=name,
            offset=0,
        )
        self._waiting.append(_Encoded(encoded, index))

    def flush(self, durable: bool = False) -> int:
        """End the open chunk and hand everything to the operating system.

        The data then survives a kill of this process; with ``durable`` also a power cut (the call
        waits for the disk). Return the file's length in bytes. Raise OSError: rows stay in memory,
        the file ends on a whole record, and the next call continues from there.
        """
        self._end_chunk()
        while self._waiting:
            first = self._waiting[0]
            encoded = first.result() if isinstance(first, Future) else first
            self._write(encoded.data)
            self._enter(encoded)
            self._waiting.popleft()
        if durable:
            os.fdatasync(self.descriptor)
        return self.committed

    def finish(self) -> None:
        """Write the summary and close. After an OSError the file is as `flush` left it; retry."""
        if self._closed:
            return
        self.flush()
        self._write(self._closing_records())
        self.close()

    def switch_file(self, path: Path) -> None:
        """Continue in another file that holds a copy of this one; raise OSError."""
        file = os.open(path, os.O_RDWR)
        os.close(self.descriptor)
        self.path, self.descriptor = path, file

    def close(self) -> None:
        """Close without a summary; the file stays recoverable."""
        if not self._closed:
            self._closed = True
            self._thread.shutdown(cancel_futures=True)
            os.close(self.descriptor)

    def _enter(self, encoded: _Encoded) -> None:
        """Count records written at the end of the file, and keep their entry of the summary."""
        entry, at = encoded.entry, self.committed
        match entry:
            case records.ChunkIndex():
                entry.chunk_start_offset = at
                entry.message_index_offsets[CHANNEL_ID] += at
                self._chunks.append(entry)
            case records.AttachmentIndex():
                entry.offset = at
                self._attachments.append(entry)
            case records.MetadataIndex():
                entry.offset = at
                self._metadata.append(entry)
        self._rows += encoded.rows
        self.committed += len(encoded.data)

    def _write(self, data: bytes) -> None:
        done = 0
        try:
            while done < len(data):
                done += os.pwrite(self.descriptor, memoryview(data)[done:], self.committed + done)
        except OSError:
            # Cut off a partly written record, so that the file holds whole records only.
            os.ftruncate(self.descriptor, self.committed)
            raise

    def _queue_metadata(self, name: str, pairs: dict[str, str]) -> None:
        checked = {**pairs, CHECKSUM_KEY: metadata_checksum(name, pairs)}
        encoded = _serialise(records.Metadata(name, checked))
        self._waiting.append(_Encoded(encoded, records.MetadataIndex(0, len(encoded), name)))

    def _end_chunk(self) -> None:
        """Hand the open chunk to the thread; wait for a free buffer."""
        if not self._filled:
            return
        messages = self._open[: self._filled]
        self._latest = int(messages["log_time"].max())
        chunk = self._thread.submit(self._encode_chunk, messages)
        self._waiting.append(chunk)
        self._compressing.append(chunk)
        if len(self._compressing) == _BUFFERS:
            self._compressing.popleft().result()
        self._buffers.append(self._buffers.pop(0))
        self._open = self._buffers[0]
        self._taken += self._filled
        self._filled = 0

    def _encode_chunk(self, messages: Any) -> _Encoded:
        """Return the records of a chunk and of its message index."""
        packed, size = self._compressor.compress(messages.view(np.uint8)), messages.nbytes
        times = messages["log_time"]
        first, last = int(times.min()), int(times.max())
        entries = self._index_entries[: len(messages)].copy()
        entries["time"] = times
        length = _CHUNK_HEAD.size + len(packed)
        head = _CHUNK_HEAD.pack(
            Opcode.CHUNK, length - 9, first, last, size, _NO_CRC, 4, b"zstd", len(packed)
        )
        index_head = _INDEX_HEAD.pack(
            Opcode.MESSAGE_INDEX, 6 + entries.nbytes, CHANNEL_ID, entries.nbytes
        )
        index = records.ChunkIndex(
            chunk_length=length,
            chunk_start_offset=0,
            compression="zstd",
            compressed_size=len(packed),
            message_end_time=last,
            message_index_length=len(index_head) + entries.nbytes,
            message_index_offsets={CHANNEL_ID: length},
            message_start_time=first,
            uncompressed_size=size,
        )
        data = b"".join((head, packed, index_head, entries.tobytes()))
        return _Encoded(data, index, len(messages))

    def _closing_records(self) -> bytes:
        """Return data end, summary, footer and closing magic for the committed length."""
        data_end = _serialise(records.DataEnd(0))
        start = self.committed + len(data_end)
        chunks, rows = self._chunks, self._rows
        statistics = records.Statistics(
            attachment_count=len(self._attachments),
            channel_count=1,
            channel_message_counts={CHANNEL_ID: rows} if rows else {},
            chunk_count=len(chunks),
            message_count=rows,
            message_end_time=max((c.message_end_time for c in chunks), default=0),
            message_start_time=min((c.message_start_time for c in chunks), default=0),
            metadata_count=len(self._metadata),
            schema_count=1,
        )
        groups: list[tuple[Opcode, list[Any]]] = [
            (Opcode.SCHEMA, [self._schema]),
            (Opcode.CHANNEL, [CHANNEL]),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, chunks),
            (Opcode.ATTACHMENT_INDEX, self._attachments),
            (Opcode.METADATA_INDEX, self._metadata),
        ]
        summary, offsets = b"", b""
        for opcode, members in groups:
            if members:
                group = _serialise(*members)
                offset = records.SummaryOffset(opcode, start + len(summary), len(group))
                offsets += _serialise(offset)
                summary += group
        directory = start + len(summary)
        footer = struct.pack("<BQQQ", Opcode.FOOTER, 20, start, directory)
        crc = zlib.crc32(summary + offsets + footer)
        return data_end + summary + offsets + footer + struct.pack("<I", crc) + MCAP0_MAGIC
