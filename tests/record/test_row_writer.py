"""The writer: a standard file whose rows survive kills and full disks."""

import ctypes
import os
import resource
import struct
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
import pytest
import record_files as files
import zstandard
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Chunk, MessageIndex
from mcap.stream_reader import StreamReader

from rig.recording import row_layout
from rig.recording.mcap_writer import CHUNK_BYTES, RowWriter
from rig.recording.runs.mcap_file import blocks, scan

# MCAP specification, record head and Message; then the encapsulation header of CDR.
MESSAGE = struct.Struct("<BQHIQQ4s")


def read(path: Path) -> Any:
    return np.concatenate([np.empty(0, files.DTYPE), *blocks(scan(path))])


def test_the_stock_reader_finds_index_statistics_and_attachments(tmp_path: Path) -> None:
    data = files.rows(3000)
    out = files.writer(tmp_path / "run.mcap", **{"plan.json": b"{}"})
    for begin in range(0, 3000, 700):
        out.append(data[begin : begin + 700].tobytes())
        out.flush()
    out.attach("status.json", b'{"status": "complete"}')
    out.finish()
    with out.path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == 3000
        assert summary.statistics.chunk_count == len(summary.chunk_indexes) == 9
        assert summary.statistics.message_start_time == files.START
        assert summary.statistics.message_end_time == files.START + 2_999_000_000
        attached = {a.name: a.data for a in reader.iter_attachments()}
        assert attached == {"plan.json": b"{}", "status.json": b'{"status": "complete"}'}
        messages = list(reader.iter_messages(topics="/row"))
        assert [m.sequence for _, _, m in messages] == list(range(3000))
        assert b"".join(m.data[4:] for _, _, m in messages) == data.tobytes()
        some = files.START + 1_234_000_000
        _, _, found = next(iter(reader.iter_messages(starting_at=some)))
        assert found.sequence == 1234


def test_the_index_of_a_chunk_locates_each_message(tmp_path: Path) -> None:
    path = files.write(tmp_path / "run.mcap", files.rows(900), flush_every=300)
    plain, indexed = b"", 0
    with path.open("rb") as file:
        for item in StreamReader(file, emit_chunks=True).records:
            if isinstance(item, Chunk):
                plain = zstandard.decompress(item.data, max_output_size=item.uncompressed_size)
            elif isinstance(item, MessageIndex):
                for log_time, offset in item.records:
                    opcode, _, _, sequence, at, _, _ = MESSAGE.unpack_from(plain, offset)
                    assert (opcode, sequence) == (Opcode.MESSAGE, indexed)
                    assert at == log_time == files.START + indexed * 1_000_000
                    indexed += 1
    assert indexed == 900


def test_a_large_block_is_split_into_chunks(tmp_path: Path) -> None:
    data = files.rows(20_000)
    out = files.writer(tmp_path / "run.mcap")
    out.append(memoryview(data.tobytes()))
    assert out.rows == 20_000
    out.finish()
    contents = scan(out.path)
    assert len(contents.chunks) > 10
    assert all(chunk.size <= CHUNK_BYTES for chunk in contents.chunks)
    assert np.array_equal(read(out.path), data)


def test_a_block_is_taken_whole_or_not_at_all(tmp_path: Path) -> None:
    out = files.writer(tmp_path / "run.mcap")
    with pytest.raises(ValueError, match="are not whole rows of 880 bytes"):
        out.append(files.rows(2).tobytes()[:-1])
    bad = files.rows(3)
    bad["time"][2] = np.nan
    with pytest.raises(ValueError, match="not a finite number"):
        out.append(bad.tobytes())
    assert out.rows == 0
    out.append(files.rows(3).tobytes())
    out.finish()
    assert len(read(out.path)) == 3


def test_rows_are_copied_out_of_the_ring(tmp_path: Path) -> None:
    data = files.rows(10)
    ring = bytearray(data.tobytes())
    out = files.writer(tmp_path / "run.mcap")
    out.append(ring)
    ring[:] = bytes(len(ring))
    out.finish()
    assert np.array_equal(read(out.path), data)


def test_an_old_run_is_never_overwritten(tmp_path: Path) -> None:
    path = files.write(tmp_path / "run.mcap", files.rows(10))
    before = path.read_bytes()
    with pytest.raises(FileExistsError):
        files.writer(path)
    assert path.read_bytes() == before


def test_finish_may_be_called_twice(tmp_path: Path) -> None:
    out = files.writer(tmp_path / "run.mcap")
    out.finish()
    length = out.path.stat().st_size
    out.finish()
    out.close()
    assert out.path.stat().st_size == length


class NoTick(NamedTuple):
    position: Annotated[float, "m"]


class NoTime(NamedTuple):
    tick: Annotated[int, "tick"]


def test_a_row_needs_tick_and_time(tmp_path: Path) -> None:
    with pytest.raises(row_layout.RowError, match="first field of a row is its tick, not position"):
        RowWriter(tmp_path / "a", row_layout.schema(NoTick), {}, {}, start_utc_ns=0)
    with pytest.raises(row_layout.RowError, match="needs a field time"):
        RowWriter(tmp_path / "b", row_layout.schema(NoTime), {}, {}, start_utc_ns=0)
    assert not list(tmp_path.iterdir())


class Disk(NamedTuple):
    """A small disk, with a function to free space."""

    folder: Path
    more: Any


@pytest.fixture(params=["file size limit", "small file system"])
def disk(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Disk]:
    free_bytes = 300_000
    if request.param == "small file system":
        folder = tmp_path / "small"
        folder.mkdir()
        mount = ["mount", "-t", "tmpfs", "-o", f"size={free_bytes}", "tmpfs", str(folder)]
        if subprocess.run(mount, capture_output=True, check=False).returncode:
            pytest.skip("no right to mount a file system")
        grow = ["mount", "-o", "remount,size=100m", str(folder)]
        yield Disk(folder, lambda: subprocess.run(grow, check=True))
        subprocess.run(["umount", str(folder)], check=True)
        return
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (free_bytes, hard))
    yield Disk(tmp_path, lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard)))
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_loses_no_row_and_leaves_whole_records(disk: Disk) -> None:
    out = files.writer(disk.folder / "run.mcap")
    random = np.random.default_rng(1)
    data = files.rows(3000)
    data["load.lcb"] = random.normal(size=3000)
    data["load.trs"] = random.normal(size=3000)
    failures = 0
    for begin in range(0, 3000, 100):
        out.append(data[begin : begin + 100].tobytes())
        try:
            out.flush()
        except OSError:
            failures += 1
            assert os.path.getsize(out.path) == out.committed
            so_far = files.salvage(out.path)
            assert so_far.unread == 0
            assert so_far.last_tick == so_far.rows - 1
    assert failures > 2
    assert 0 < so_far.rows < 3000
    with pytest.raises(OSError, match=r"large|space"):
        out.finish()
    disk.more()
    out.finish()
    assert np.array_equal(read(out.path), data)
    with out.path.open("rb") as file:
        assert len(list(make_reader(file, validate_crcs=True).iter_messages())) == 3000


def test_without_space_for_the_head_no_file_remains(tmp_path: Path) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, hard))
    try:
        with pytest.raises(OSError, match="large"):
            files.writer(tmp_path / "run.mcap")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert not list(tmp_path.iterdir())


def test_close_without_finish_leaves_a_readable_file(tmp_path: Path) -> None:
    out = files.writer(tmp_path / "run.mcap")
    out.append(files.rows(100).tobytes())
    out.flush()
    out.append(files.rows(100, 100).tobytes())
    assert out.pending >= 100 * 808
    out.close()
    assert files.salvage(out.path).last_tick == 99


PAGE_FAULTS = """
import resource, sys
from pathlib import Path
import numpy as np
import record_files as files
from rig.processes.logger import keep_freed_memory

out = files.writer(Path(sys.argv[1]))
rows = files.rows(100)  # a short block: the C library also keeps what is less than it once freed
for name in set(rows.dtype.names) - {"tick", "tick_end", "time"}:  # hard to compress
    rows[name] = np.random.default_rng(len(name)).integers(1 << 60, size=100)
data = rows.tobytes()

def write():
    for _ in range(10):
        for _ in range(100):
            out.append(data)
        out.flush()

keep_freed_memory()
write()
before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
write()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before)
"""


@pytest.mark.skipif(not hasattr(ctypes.CDLL(None), "mallopt"), reason="needs glibc")
def test_the_logger_writes_chunks_without_new_pages(tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", PAGE_FAULTS, str(tmp_path / "run.mcap")],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parent)},
    )
    assert int(done.stdout) < 200  # above 1000 in half of all processes otherwise
