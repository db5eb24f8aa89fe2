"""The tap of the ring: a reader that leaves no trace, and the buckets of what it reads."""

from __future__ import annotations

import mmap
import os
from collections.abc import Iterator
from typing import Annotated, NamedTuple

import numpy as np
import pytest

from rig.page.buckets import Buckets, merged
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
    found = [each for part in np.split(rows, [7, 90, 91]) for each in buckets.add(part)]
    assert len(found) == 4  # thirty rows wait
    assert found[0].low[2] == np.sin(np.arange(50)).min()
    assert found[0].high[2] == np.sin(np.arange(50)).max()
    assert found[1].high[2] == np.sin(np.arange(50, 60)).max()  # NaN is left out
    assert found[3].time == pytest.approx(0.199)
    few = merged(found, 2)
    assert [each.time for each in few] == [found[1].time, found[3].time]
    assert few[0].high[2] == max(found[0].high[2], found[1].high[2])


def test_buckets_keep_an_hour_in_three_levels() -> None:
    buckets, second = Buckets(2, 0, DT), round(1 / DT)
    rows = np.zeros((10 * second, 2))
    for i in range(400):
        rows[:, 0] = 10.0 * i + DT * np.arange(len(rows))
        rows[:, 1] = 1.0 if i == 399 else 0.0
        rows[5, 1] = -5.0 if i == 100 else rows[5, 1]  # one row in an hour
        buckets.add(rows)
    levels = (buckets.recent, *buckets.coarser)
    assert [len(level) for level in levels] == [1200] * 3
    spans = [level[-1].time - level[0].time for level in levels]
    assert spans == pytest.approx([60.0, 600.0, 3600.0], rel=0.01)
    assert [min(each.low[1] for each in level) for level in levels] == [0.0, 0.0, -5.0]
    assert all(level[-1].low[1] == level[-1].high[1] == 1.0 for level in levels)
    buckets.clear()
    assert not any(levels)
