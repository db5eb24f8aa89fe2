"""Flipped bits and cuts of a record: readers return all intact rows and no wrong ones."""

from __future__ import annotations

import json
import random
import time
import tracemalloc
from collections.abc import Iterator
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import record_files as files
from mcap.opcode import Opcode

from rig.recording.runs import RunError, join, mcap_file, open_run
from rig.recording.runs.mcap_file import scan
from rig.recording.runs.mcap_records import RECORD
from rig.recording.runs.recover import recover

NOW = datetime(2026, 1, 2, 3, 4, 5, tzinfo=UTC)
ROWS, PER_CHUNK, CASES = 60, 6, 20
FINISHED, KILLED = "run.mcap", "run.mcap.part0"
parts = pytest.mark.parametrize("part", range(5))  # each has other random cases


def rows() -> Any:
    block = files.rows(ROWS)
    block["timing.skipped"] = 0
    return block


@cache
def good(folder: Path, name: str) -> tuple[bytes, tuple[tuple[int, int], ...]]:
    """Return a small record and the location of each of its chunks."""
    path = folder / name
    out = files.writer(path, **{"config.json": b'{"name": "small"}', "plan.json": b"{}" * 50})
    data = rows()
    for begin in range(0, ROWS, PER_CHUNK):
        out.append(data[begin : begin + PER_CHUNK].tobytes())
        out.flush()
    if name == FINISHED:
        out.attach("status.json", json.dumps({"status": "complete", "ticks": ROWS}).encode())
        out.finish()
    else:
        out.close()
    head = RECORD.size + 28 + 4 + 4 + 8
    spans = tuple((c.offset - head, c.offset + c.length) for c in scan(path).chunks)
    return path.read_bytes(), spans


def records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield kind, begin and end of every record."""
    at = 8
    while at + RECORD.size <= len(data):
        opcode, length = RECORD.unpack_from(data, at)
        yield opcode, at, at + RECORD.size + length
        at += RECORD.size + length


def places(data: bytes, dice: random.Random) -> list[int]:
    """Choose bytes to damage: a third anywhere, a third in record heads, a third by kind."""
    every = list(records(data))
    kinds = sorted({opcode for opcode, _, _ in every})
    found = [0, 5, len(data) - 3]  # the magic at both ends
    while len(found) < CASES:
        match len(found) % 3:
            case 0:
                found.append(dice.randrange(len(data)))
            case 1:
                _, begin, end = dice.choice(every)
                found.append(dice.randrange(begin, min(begin + 50, end)))
            case _:
                kind = dice.choice(kinds)
                _, begin, end = dice.choice([each for each in every if each[0] == kind])
                found.append(dice.randrange(begin, end))
    return found


def read(path: Path) -> Any:
    """Return the rows of `open_run` as records."""
    data = open_run(path)
    out = np.zeros(data.sizes["time"], files.DTYPE)
    for name in files.DTYPE.names or ():
        assert name in data.variables, f"{name} is no field"
        out[name] = data[name].values
    return out, data.attrs


def check_rows(found: Any, expected: Any, where: str) -> None:
    """Check that every row is correct, each tick occurs once, and undamaged chunks are complete."""
    ticks = found["tick"].astype(np.int64)
    assert len(np.unique(ticks)) == len(ticks), where
    assert ((ticks >= 0) & (ticks < ROWS)).all(), where
    assert found.tobytes() == rows()[ticks].tobytes(), where
    assert set(expected) <= set(ticks.tolist()), where


def of_chunks(spans: tuple[tuple[int, int], ...], whole: list[bool]) -> list[int]:
    return [
        tick
        for number in range(len(spans))
        if whole[number]
        for tick in range(number * PER_CHUNK, (number + 1) * PER_CHUNK)
    ]


def check_damaged(
    folder_path: Path, name: str, data: bytes, expected: list[int], where: str
) -> None:
    """Check readers and a recovery in place on a damaged record."""
    folder_path.mkdir()
    (folder_path / name).write_bytes(data)
    status: dict[str, Any] = {"status": "complete", "ticks": ROWS, "last_tick": ROWS - 1}
    (folder_path / "run.json").write_text(json.dumps({**status, "skipped": 0}))
    try:
        found, report = read(folder_path)
    except RunError:
        if expected:
            raise
        for refused in (read, lambda run: recover(run, None, NOW)):
            with pytest.raises(RunError, match=r"rig recover"):
                refused(folder_path)
        return
    check_rows(found, expected, where)
    lost = ROWS - len(found)
    if lost:
        assert report["record"] != "complete", where
        assert f"{lost} of {ROWS} ticks missing" in report["record"], where
    recovery = recover(folder_path, None, NOW)
    assert (folder_path / name).read_bytes() == data, where
    assert (recovery.account.rows, recovery.account.lost) == (len(found), lost), where
    blocks = list(mcap_file.blocks(scan(recovery.output)))
    second = np.concatenate(blocks) if blocks else found[:0]
    assert second.tobytes() == found.tobytes(), where
    assert read(folder_path)[0].tobytes() == found.tobytes(), where


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("good")


@pytest.mark.sampled
@parts
@pytest.mark.parametrize("name", [FINISHED, KILLED])
def test_a_flipped_bit_costs_its_chunk_at_most(
    name: str, part: int, folder: Path, tmp_path: Path
) -> None:
    data, spans = good(folder, name)
    dice = random.Random(f"flips {name} {part}")
    for number, at in enumerate(places(data, dice)):
        changed = bytearray(data)
        changed[at] ^= 1 << dice.randrange(8)
        expected = of_chunks(spans, [not begin <= at < end for begin, end in spans])
        check_damaged(
            tmp_path / str(number), name, bytes(changed), expected, f"case {number}, byte {at}"
        )


@pytest.mark.sampled
@parts
@pytest.mark.parametrize("first", [36, 33])  # tick of the second file: without and with overlap
def test_a_flipped_bit_in_one_of_two_files_costs_its_chunk_at_most(
    first: int, part: int, tmp_path: Path
) -> None:
    """A flip in the times of a chunk's head, which have no check sum, costs no row."""
    data, dice = rows(), random.Random(f"{first} {part}")
    paths = [tmp_path / f"{FINISHED}.part{number}" for number in (0, 1)]
    for path, some in zip(paths, (data[:36], data[first:]), strict=True):
        files.write(path, some, PER_CHUNK, finish=False)
    status = {"status": "complete", "ticks": ROWS, "last_tick": ROWS - 1, "skipped": 0}
    (tmp_path / "run.json").write_text(json.dumps(status))
    undamaged = [path.read_bytes() for path in paths]
    chunks = [
        (number, begin, end)
        for number, content in enumerate(undamaged)
        for opcode, begin, end in records(content)
        if opcode == Opcode.CHUNK
    ]
    for case in range(CASES // 2):
        number, begin, end = dice.choice(chunks)
        folder_path = dice.randrange(RECORD.size, RECORD.size + 16 if case % 2 else end - begin)
        times = folder_path < RECORD.size + 16
        changed = bytearray(undamaged[number])
        changed[begin + folder_path] ^= 1 << dice.randrange(8)
        paths[number].write_bytes(changed)
        where = f"case {case}: byte {begin + folder_path} of file {number}"
        found, report = read(tmp_path)
        check_rows(found, range(ROWS) if times else (), where)
        lost = ROWS - len(found)
        assert lost <= PER_CHUNK, where
        assert (f"{lost} of {ROWS} ticks missing" in report["record"]) == (lost > 0), where
        joined = join(paths, tmp_path / "joined.mcap")
        assert (joined.rows, bool(joined.damage)) == (ROWS - lost, bool(lost)), where
        joined.path.unlink()
        paths[number].write_bytes(undamaged[number])


@pytest.mark.sampled
@parts
@pytest.mark.parametrize("name", [FINISHED, KILLED])
def test_a_cut_costs_only_the_rows_after_it(
    name: str, part: int, folder: Path, tmp_path: Path
) -> None:
    data, spans = good(folder, name)
    dice = random.Random(f"{name} {part}")
    for number, length in enumerate(dice.sample(range(len(data)), CASES)):
        expected = of_chunks(spans, [end <= length for _, end in spans])
        check_damaged(tmp_path / str(number), name, data[:length], expected, f"cut at {length}")


@pytest.mark.sampled
@parts
def test_a_hole_costs_only_the_chunks_it_touches(part: int, folder: Path, tmp_path: Path) -> None:
    """Bytes are missing in the middle, so that lengths lead past the next record."""
    data, spans = good(folder, FINISHED)
    dice = random.Random(f"holes {part}")
    for number in range(CASES // 2):
        begin = dice.randrange(spans[0][0], len(data) - 100)
        end = begin + dice.randrange(1, 3000)
        whole = [last <= begin or first >= end for first, last in spans]
        expected = of_chunks(spans, whole)
        changed = data[:begin] + data[end:]
        check_damaged(tmp_path / str(number), FINISHED, changed, expected, f"hole {begin} to {end}")


def test_huge_lengths_cost_neither_memory_nor_time(folder: Path, tmp_path: Path) -> None:
    data, spans = good(folder, FINISHED)
    lengths = [begin + 1 for _, begin, _ in records(data)]  # of records
    for begin, _ in spans:  # of a chunk's compressed and plain data, and of zstd's frame
        lengths += [begin + 9 + 16, begin + 9 + 28 + 8, begin + 9 + 28 + 4 + 4 + 8 + 4]
    tracemalloc.start()
    began = time.perf_counter()
    for number, at in enumerate(lengths):
        for byte in (3, 5, 7):
            changed = bytearray(data)
            changed[at + byte] ^= 0x7F
            path = tmp_path / f"{number}.mcap"
            path.write_bytes(changed)
            reading = open_run(path, ["tick", "time"])
            assert reading.sizes["time"] >= ROWS - PER_CHUNK, f"length at {at}"
    duration, peak = time.perf_counter() - began, tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 64e6
    assert duration / (3 * len(lengths)) < 0.2


def test_the_index_is_not_needed(folder: Path, tmp_path: Path) -> None:
    data, _ = good(folder, FINISHED)
    (end,) = (begin for opcode, begin, _ in records(data) if opcode == Opcode.DATA_END)
    for name, changed in (("cut", data[: end + 100]), ("zero", data[: end + 40] + bytes(500))):
        path = tmp_path / f"{name}.mcap"
        path.write_bytes(changed)
        found = open_run(path, "load.lcb")
        assert found.sizes["time"] == ROWS
        assert found.attrs["record"].startswith("damaged: every known tick has its row")
        assert "its index" in found.attrs["record_damage"]


def test_a_flipped_bit_in_the_head_costs_no_row(folder: Path, tmp_path: Path) -> None:
    """Every byte of the description of the rows has a copy or a check sum."""
    data, spans = good(folder, KILLED)
    leaves = scan(folder / KILLED).leaves
    path, dice = tmp_path / KILLED, random.Random(8)
    heads = [(begin, end) for _, begin, end in records(data) if end <= spans[0][0]]
    for at in (at for begin, end in heads for at in range(begin, end) if at - begin < 90):
        changed = bytearray(data)
        changed[at] ^= 1 << dice.randrange(8)
        path.write_bytes(changed)
        found = scan(path)
        assert (found.leaves, len(found.chunks)) == (leaves, len(spans)), at
        report = found.metadata.get("clock", {"start_utc_ns": str(files.START)})
        assert report == {"start_utc_ns": str(files.START)}, at
