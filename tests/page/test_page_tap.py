"""The tap of the ring: a reader that leaves no trace, and the buckets of what it reads."""

from __future__ import annotations

import mmap
import os
import subprocess
import sys
import tracemalloc
from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
import pytest

from rig.page.buckets import Buckets, Extremes, merged
from rig.page.tap import RingTap
from rig.recording import ring
from rig.recording.row_layout import leaves

DT = 1e-3


class SmallRow(NamedTuple):
    tick: Annotated[int, "tick"]
    time: Annotated[float, "s"]
    value: Annotated[float, "m"]
    tick_end: Annotated[int, "tick"]


LEAVES = leaves(SmallRow)


@pytest.fixture
def memory() -> Iterator[int]:
    descriptor = ring.create(SmallRow)
    yield descriptor
    os.close(descriptor)


def read_only(descriptor: int) -> int:
    return os.open(f"/proc/self/fd/{descriptor}", os.O_RDONLY)


def fill(writer: ring.RingWriter, first: int, count: int) -> None:
    for tick in range(first, first + count):
        writer.put(SmallRow(tick, tick * DT, float(tick), tick))


def test_the_tap_reads_every_row_once_and_moves_nothing(memory: int) -> None:
    writer = ring.RingWriter(memory, SmallRow, wait=False)
    tap = RingTap(read_only(memory), LEAVES, DT)
    before = ring.RingReader(memory)
    found = [tap.poll()]
    for first in (0, 100, 250):
        fill(writer, first, 150)
        found.append(tap.poll())
    writer.finish()
    found.append(tap.poll())
    ticks = np.concatenate(found)[:, 0]
    written = [*range(150), *range(100, 250), *range(250, 400)]
    # The rows of the ring, each once; a tick that came twice only counts once.
    assert ticks.tolist() == sorted(set(written))
    assert before.tail == 0
    assert tap.status()["ended"]
    assert tap.status()["unsaved"] == len(written)


def test_a_late_joiner_gets_the_last_minute(memory: int) -> None:
    writer = ring.RingWriter(memory, SmallRow, wait=False)
    fill(writer, 0, 64_000)
    tap = RingTap(read_only(memory), LEAVES, DT)
    rows = np.concatenate([tap.poll(), tap.poll()])
    assert rows[0, 0] == 4_000
    assert rows[-1, 0] == 63_999
    assert len(rows) == 60_000


def test_the_map_can_only_be_read(memory: int) -> None:
    view = ring.RingView(read_only(memory))
    with pytest.raises(TypeError):
        view._map[0] = 1
    with pytest.raises(PermissionError):
        mmap.mmap(read_only(memory), mmap.PAGESIZE, prot=mmap.PROT_READ | mmap.PROT_WRITE)


def test_torn_and_replaced_rows_are_left_out(memory: int) -> None:
    writer = ring.RingWriter(memory, SmallRow, wait=False)
    fill(writer, 0, 10)
    with mmap.mmap(memory, 0) as shared:
        size = 8 * len(LEAVES)
        start = mmap.PAGESIZE
        numbers = np.frombuffer(shared, "<i8", 10 * len(LEAVES), start).reshape(10, -1)
        numbers[3, -1] = 77  # torn: its end belongs to another row
        numbers[5, 0] = numbers[5, -1] = 70_000  # replaced as a whole by a row of the next lap
        del numbers
        assert size == writer.row_size
    tap = RingTap(read_only(memory), LEAVES, DT)
    writer.finish()
    rows = tap.poll()
    assert rows[:, 0].tolist() == [0, 1, 2, 4, 6, 7, 8, 9]
    assert tap.torn == 2


def test_a_tap_of_another_layout_is_refused(memory: int) -> None:
    with pytest.raises(ValueError, match="32 bytes, its schema 24"):
        RingTap(read_only(memory), LEAVES[:3], DT)


def test_a_tap_that_slept_longer_than_the_ring_goes_on(memory: int) -> None:
    """A page that was suspended leaves out what the loop has overwritten since."""
    writer, reader = ring.RingWriter(memory, SmallRow, wait=False), ring.RingReader(memory)
    tap = RingTap(read_only(memory), LEAVES, DT)
    for first in range(0, 200_000, 8_000):
        fill(writer, first, 8_000)
        while len(reader.take()):
            pass
        while len(reader.take()):
            pass
        reader.commit()
    tap.poll()
    rows = tap.poll()
    assert rows[-1, 0] == 199_999
    assert rows[0, 0] >= 200_000 - ring.CAPACITY
    assert (np.diff(rows[:, 0]) == 1).all()


def test_buckets_have_the_extremes_of_fifty_rows() -> None:
    rows = np.array([[i, i * DT, np.sin(i), i] for i in range(230)], float)
    rows[60:100, 2] = np.nan
    buckets = Buckets(4, 1, DT)
    parts = [buckets.add(part) for part in np.split(rows, [7, 90, 91])]
    assert [each.size for each in parts] == [0, 1, 0, 3]  # thirty rows wait
    found = Extremes(*(np.concatenate(each) for each in zip(*parts, strict=True)))
    assert found.low[0, 2] == np.sin(np.arange(50)).min()
    assert found.high[0, 2] == np.sin(np.arange(50)).max()
    assert found.high[1, 2] == np.sin(np.arange(50, 60)).max()  # NaN is left out
    assert found.time[3] == pytest.approx(0.199)
    newest = buckets.newest(0.1, [2, 0])  # of all that were found the last two
    assert newest.low.tolist() == found.low[2:, [2, 0]].tolist()
    few = merged(found, 2)
    assert few.time.tolist() == found.time[[1, 3]].tolist()
    assert few.high[0, 2] == found.high[:2, 2].max()
    assert merged(found, 4).high.tolist() == found.high.tolist()


def test_a_bucket_without_numbers_stays_without() -> None:
    rows = np.full((100, 2), np.nan)
    rows[:, 0] = DT * np.arange(100)
    found = Buckets(2, 0, DT).add(rows)
    assert np.isnan(found.low[:, 1]).all()
    assert np.isnan(found.high[:, 1]).all()


def test_buckets_keep_an_hour_in_three_levels() -> None:
    buckets, second = Buckets(2, 0, DT), round(1 / DT)
    rows = np.zeros((10 * second, 2))
    for i in range(400):
        rows[:, 0] = 10.0 * i + DT * np.arange(len(rows))
        rows[:, 1] = 1.0 if i == 399 else 0.0
        rows[5, 1] = -5.0 if i == 100 else rows[5, 1]  # one row in an hour
        buckets.add(rows)
    levels = buckets.history([1])
    assert [level.size for level in levels] == [1200] * 3
    spans = [level.time[-1] - level.time[0] for level in levels]
    assert spans == pytest.approx([60.0, 600.0, 3600.0], rel=0.01)
    assert all((np.diff(level.time) > 0.0).all() for level in levels)
    assert [level.low.min() for level in levels] == [0.0, 0.0, -5.0]
    assert all(level.low[-1] == level.high[-1] == 1.0 for level in levels)
    buckets.clear()
    assert [level.size for level in buckets.history([1])] == [0] * 3


def test_a_block_longer_than_a_level_leaves_its_newest_buckets() -> None:
    """A page that was suspended gets the rows of more than a minute at once."""
    rows = np.arange(90_000.0)[:, None] * [DT, 1.0]
    at_once, bit_by_bit = Buckets(2, 0, DT), Buckets(2, 0, DT)
    at_once.add(rows)
    for part in np.split(rows, 90):
        bit_by_bit.add(part)
    for one, other in zip(at_once.history([0, 1]), bit_by_bit.history([0, 1]), strict=True):
        assert all((a == b).all() for a, b in zip(one, other, strict=True))


def test_the_memory_of_an_hour_is_resident_from_the_start() -> None:
    """A new process: in an old one the buckets could get memory that is resident already."""
    script = f"""
from rig.page.buckets import Buckets
def resident():
    return int(open("/proc/self/statm").read().split()[1])
before = resident()
buckets = Buckets(1000, 0, {DT})
print(resident() - before)
"""
    found = subprocess.run([sys.executable, "-c", script], stdout=subprocess.PIPE, check=True)
    # Three levels of 1200 buckets, each with two numbers of 8 bytes a field.
    assert int(found.stdout) * mmap.PAGESIZE > 0.9 * (3 * 1200 * 2 * 8 * 1000)


def test_an_hour_of_rows_needs_no_more_memory_than_the_first_minute() -> None:
    """All memory is there from the start: what an hour of rows adds is gone after each block."""
    tracemalloc.start()
    try:
        buckets = Buckets(100, 0, DT)
        rows = np.zeros((10_000, 100))
        buckets.add(rows)
        first, _ = tracemalloc.get_traced_memory()
        for i in range(1, 360):
            rows[:] = float(i)
            buckets.add(rows)
        last, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    # A level of 1200 buckets has 2 MB; a bucket that is kept anew would add 1.6 kB to each.
    assert last - first < 20_000
