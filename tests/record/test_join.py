"""Killed writers: flushed rows are readable, parts join to one file, failures are reported."""

import json
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pytest
import record_files as files
from mcap.reader import make_reader
from mcap.writer import Writer

from rig.kinds.wavebot.tick import WaveBotRow
from rig.recording import row_layout, runs
from rig.recording.runs import RunError, mcap_records
from rig.recording.runs.mcap_file import blocks, scan

WRITER = """
import sys
sys.path.insert(0, sys.argv[2])
from pathlib import Path
import record_files as files
out = files.writer(Path(sys.argv[1]))
data = files.rows(20_000)
for begin in range(0, 20_000, 50):
    out.append(data[begin : begin + 50].tobytes())
    out.flush()
    print(begin + 50, flush=True)
out.finish()
"""


def test_a_kill_loses_only_unflushed_rows(tmp_path: Path) -> None:
    chance = random.Random(7)
    here = str(Path(__file__).parent)
    killed_running = 0
    for attempt in range(10):
        path = tmp_path / f"run{attempt}.mcap"
        command = [sys.executable, "-c", WRITER, str(path), here]
        with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as child:
            assert child.stdout is not None
            output = [child.stdout.readline()]
            time.sleep(chance.uniform(0.0, 0.15))
            child.send_signal(signal.SIGKILL)
            output += child.stdout.readlines()
        flushed = int([line for line in output if line.endswith("\n")][-1])
        found = files.salvage(path)
        assert found.rows >= flushed
        assert found.last_tick == found.rows - 1
        assert found.rows <= flushed + 100  # the next block may be written, but not reported yet
        assert not found.damage
        killed_running += not found.finished
    assert killed_running > 0


def test_a_truncated_file_gives_the_rows_before_the_cut(tmp_path: Path) -> None:
    whole = files.write(tmp_path / "whole.mcap", files.rows(2000), flush_every=200)
    data = whole.read_bytes()
    chunks = scan(whole).chunks
    for length in random.Random(3).sample(range(chunks[0].offset - 40, len(data)), 60):
        path = tmp_path / "cut.mcap"
        path.write_bytes(data[:length])
        rows = 200 * sum(chunk.offset + chunk.length <= length for chunk in chunks)
        if rows == 0:
            assert scan(path).chunks == ()
            continue
        found = files.salvage(path)
        assert found.rows == rows
        assert np.array_equal(np.concatenate(found.blocks), files.rows(rows))


def test_the_stock_reader_needs_the_join(tmp_path: Path) -> None:
    part = files.write(tmp_path / "run.mcap.part0", files.rows(1000), finish=False)
    with part.open("rb") as file, pytest.raises(Exception, match=r".*"):
        list(make_reader(file).iter_messages())
    joined = runs.join([part], tmp_path / "run.mcap")
    assert joined.clean
    with joined.path.open("rb") as file:
        assert len(list(make_reader(file, validate_crcs=True).iter_messages())) == 1000


def test_parts_join_without_duplicates_and_gaps_are_reported(tmp_path: Path) -> None:
    first, second, third = (tmp_path / f"run.mcap.part{i}" for i in range(3))
    out = files.writer(first, **{"plan.json": b"{}", "status.json": b"old"})
    out.append(files.rows(1000).tobytes())
    out.flush()
    out.close()
    files.write(second, files.rows(800, 900), finish=False)  # 100 duplicate rows
    out = files.writer(third)
    out.append(files.rows(300, 1750).tobytes())  # 50 rows are lost
    out.attach("status.json", b"new")
    out.finish()
    joined = runs.join([first, second, third], tmp_path / "run.mcap")
    assert (joined.rows, joined.duplicates, joined.missing) == (2000, 100, 50)
    assert joined.gaps == ((1700, 1749),)
    assert not joined.clean
    ticks = np.concatenate([block["tick"] for block in blocks(scan(joined.path))])
    assert ticks.tolist() == [*range(1700), *range(1750, 2050)]
    inside = runs.attachments(joined.path)
    record = json.loads(inside.pop("recovery.json"))
    assert inside == {"plan.json": b"{}", "status.json": b"new"}
    assert record["parts"] == [part.name for part in (first, second, third)]
    assert (record["rows"], record["absent_ticks"]) == (2000, [[1700, 1749]])
    assert scan(joined.path).metadata["run"] == {"run": "test"}
    assert not list(tmp_path.glob("*.joining"))


def test_a_damaged_chunk_is_skipped_and_reported(tmp_path: Path) -> None:
    path = files.write(tmp_path / "run.mcap", files.rows(1000), flush_every=100)
    chunk = scan(path).chunks[3]
    data = bytearray(path.read_bytes())
    data[chunk.offset + chunk.length // 2] ^= 0xFF
    path.write_bytes(data)
    found = files.salvage(path)
    assert found.rows == 900
    assert len(found.damage) == 1
    assert f"chunk at byte {chunk.offset}" in found.damage[0]
    data = runs.open_run(path, "load")
    assert data.sizes["time"] == 900
    assert f"chunk at byte {chunk.offset}" in data.attrs["record_damage"]
    joined = runs.join([path], tmp_path / "out.mcap")
    assert joined.gaps == ((300, 399),)
    assert joined.damage


@pytest.mark.parametrize("block", [1, 37, 1 << 20])  # bytes searched at a time
def test_a_destroyed_record_head_does_not_hide_what_follows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, block: int
) -> None:
    monkeypatch.setattr(mcap_records, "_SEARCH_BYTES", block)
    path = files.write(tmp_path / "run.mcap", files.rows(1000), flush_every=100, finish=False)
    contents = scan(path)
    begin = contents.chunks[4].offset - 50
    data = bytearray(path.read_bytes())
    data[begin : begin + 40] = b"\xee" * 40
    path.write_bytes(data)
    found = files.salvage(path)
    assert found.rows == 900
    assert found.damage
    assert found.unread > 0


def test_an_unreadable_file_is_no_success(tmp_path: Path) -> None:
    empty, head, rubbish = (tmp_path / name for name in ("empty", "head", "rubbish"))
    empty.write_bytes(b"")
    whole = files.write(tmp_path / "run.mcap.part0", files.rows(100))
    head.write_bytes(whole.read_bytes()[:60])
    data = bytearray(whole.read_bytes())
    chunk = scan(whole).chunks[0]
    data[chunk.offset : chunk.offset + chunk.length] = bytes(chunk.length)
    rubbish.write_bytes(data)
    for path, output in (
        (empty, "empty"),
        (head, "no channel"),
        (rubbish, "none of the parts' rows is readable"),
    ):
        with pytest.raises(RunError, match=output):
            runs.join([path], tmp_path / "out.mcap")
    with pytest.raises(FileNotFoundError):
        runs.join([tmp_path / "nothing"], tmp_path / "out.mcap")
    with pytest.raises(RunError, match="no parts"):
        runs.join([], tmp_path / "out.mcap")
    assert not (tmp_path / "out.mcap").exists()
    joined = runs.join([whole, empty], tmp_path / "out.mcap")  # one readable part is enough
    assert joined.rows == 100
    assert "empty" in joined.damage[0]
    with pytest.raises(FileExistsError):
        runs.join([whole], tmp_path / "out.mcap")


def test_a_part_without_rows_is_not_damage(tmp_path: Path) -> None:
    part = files.write(tmp_path / "run.mcap.part0", files.rows(0), finish=False)
    found = files.salvage(part)
    assert (found.rows, found.last_tick, found.damage) == (0, None, [])
    assert runs.join([part], tmp_path / "run.mcap").clean


@pytest.mark.parametrize("loose", [False, True])
def test_without_metadata_the_start_comes_from_a_row(tmp_path: Path, loose: bool) -> None:
    """The clock's metadata, the first chunk and the time in another chunk's head are damaged."""
    part = tmp_path / "run.mcap.part0"
    if loose:
        with part.open("wb") as file:
            write_loose(file, files.rows(100, 50))
    else:
        files.write(part, files.rows(1000), flush_every=100, finish=False)
        data = bytearray(part.read_bytes())
        data[data.index(b"start_utc_ns")] ^= 1
        damaged, readable = scan(part).chunks[:2]
        data[damaged.offset + damaged.length // 2] ^= 0xFF
        data[readable.offset - 44] ^= 0x10  # the start time in the head of the second chunk
        part.write_bytes(data)
    assert "clock" not in scan(part).metadata
    joined = runs.join([part], tmp_path / "run.mcap")
    assert joined.rows == (100 if loose else 900)
    assert scan(joined.path).metadata["clock"] == {"start_utc_ns": str(files.START)}


def write_loose(file: BinaryIO, rows: Any) -> None:
    """Write a file like another writer: messages without chunks, no metadata."""
    form = row_layout.schema(WaveBotRow)
    out = Writer(file, use_chunking=False)
    out.start("ros2", "another")
    schema = out.register_schema(form.name, "ros2msg", form.text.encode())
    channel = out.register_channel("/row", "cdr", schema)
    for row in rows:
        at = files.START + int(row["time"] * 1e9 + 0.5)
        out.add_message(channel, at, row_layout.CDR_HEADER + row.tobytes(), at)
    out.finish()
