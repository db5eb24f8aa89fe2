"""The ring against a list model, its hazards one by one, and a killed producer."""

from __future__ import annotations

import ctypes
import os
import signal
import struct
import threading
import time
from collections.abc import Iterator
from typing import Annotated, NamedTuple

import pytest
from core_process import output, start
from core_runs import unflatten
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from rig.recording import ring
from rig.recording.ring import ProducerState, RingReader, RingWriter, TornRowError
from rig.recording.row_layout import layout

Tick = Annotated[int, "tick"]


class Inner(NamedTuple):
    force: Annotated[float, "N"]
    count: Annotated[int, "count"]


class Row(NamedTuple):
    tick: Tick
    inner: Inner
    tick_end: Tick


SIZE = layout(Row).size
HEADER = os.sysconf("SC_PAGE_SIZE")


def row(n: int) -> Row:
    return Row(n, Inner(n * 0.5, -n), n)


def packed(n: int) -> bytes:
    return layout(Row).pack(n, n * 0.5, -n, n)


def decode(block: bytes | memoryview) -> list[Row]:
    return [unflatten(Row, values) for values in layout(Row).iter_unpack(block)]


@pytest.fixture
def fd() -> Iterator[int]:
    ring_fd = ring.create(Row, 8)
    yield ring_fd
    os.close(ring_fd)


class Model:
    """Model of a ring by lists."""

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self.put: list[int] = []
        self.dropped = self.tail = self.taken = self.shown = 0

    def places(self) -> int:
        """Return the number of places for rows from the next one to the end of the memory."""
        head = len(self.put)
        return min(self.capacity - head + self.tail, self.capacity - head % self.capacity)


STEPS = st.lists(
    st.one_of(
        st.tuples(st.just("put"), st.integers(1, 12)),
        st.tuples(st.just("block"), st.integers(1, 12)),
        st.tuples(st.just("take"), st.integers(1, 12)),
        st.tuples(st.just("commit"), st.just(0)),
        st.tuples(st.just("restart"), st.just(0)),
    ),
    max_size=60,
)


@settings(max_examples=examples(200))
@given(st.integers(2, 9), STEPS)
def test_the_ring_behaves_like_a_list(capacity: int, steps: list[tuple[str, int]]) -> None:
    ring_fd = ring.create(Row, capacity)
    try:
        writer, reader, model = (
            RingWriter(ring_fd, Row, wait=False),
            RingReader(ring_fd),
            Model(capacity),
        )
        number = 0
        for what, count in steps:
            if what == "put":
                for _ in range(count):
                    writer.put(row(number))
                    if len(model.put) - model.tail < capacity:
                        model.put.append(number)
                    else:
                        model.dropped += 1
                    number += 1
            elif what == "block":
                address, places = writer.reserve(count)
                assert places == (min(count, model.places()) or 1)
                block = b"".join(packed(n) for n in range(number, number + places))
                ctypes.memmove(address, block, len(block))
                published = (places + 1) // 2  # a block may end early
                writer.publish(published)
                if model.places():
                    model.put += range(number, number + published)
                else:
                    model.dropped += 1
                number += published
            elif what == "take":
                got = [one.tick for one in decode(reader.take(count))]
                # only rows seen by the previous poll, one contiguous part at a time
                stretch = capacity - model.taken % capacity
                max_rows = max(0, min(model.shown - model.taken, count, stretch))
                assert got == model.put[model.taken : model.taken + max_rows]
                model.taken += max_rows
                model.shown = len(model.put)
            elif what == "commit":
                reader.commit()
                model.tail = model.taken
            else:
                reader = RingReader(ring_fd)  # a new logger continues from the tail
                model.taken = model.shown = model.tail
            assert (reader.head, reader.tail) == (len(model.put), model.tail)
            assert reader.dropped == model.dropped
            assert reader.uncommitted == model.taken - model.tail
            assert reader.pending == len(model.put) - model.taken
            newest = reader.latest()
            assert (decode(newest) if newest else []) == [row(n) for n in model.put[-1:]]
        writer.finish()
        rest = []
        while block := reader.take():
            rest += decode(block)
        assert rest == [row(n) for n in model.put[model.taken :]]
    finally:
        os.close(ring_fd)


def test_a_full_ring_drops_and_counts(fd: int) -> None:
    writer, reader = RingWriter(fd, Row, wait=False), RingReader(fd)
    for n in range(11):
        writer.put(row(n))
    assert (reader.head, reader.dropped) == (8, 3)
    writer.finish()
    assert [one.tick for one in decode(reader.take())] == list(range(8))


def test_a_writer_waits_for_space_in_a_full_ring(fd: int) -> None:
    writer, reader = RingWriter(fd, Row, wait=True), RingReader(fd)
    for n in range(8):
        writer.put(row(n))
    late = threading.Thread(target=writer.put, args=(row(8),))
    late.start()
    late.join(timeout=0.05)
    assert late.is_alive()
    assert reader.take() == b""  # the first poll only reads the head
    assert [one.tick for one in decode(reader.take())] == list(range(8))
    assert late.is_alive()  # taken, but not committed
    reader.commit()
    late.join(timeout=10)
    assert not late.is_alive()
    assert (reader.head, reader.dropped) == (9, 0)
    assert 0.05e9 < reader.waited_ns < 60e9


def test_a_writer_does_not_wait_for_an_abandoned_reader(fd: int) -> None:
    writer, reader = RingWriter(fd, Row, wait=True), RingReader(fd)
    for n in range(8):
        writer.put(row(n))
    late = threading.Thread(target=writer.put, args=(row(8),))
    late.start()
    reader.abandon()
    late.join(timeout=10)
    assert not late.is_alive()
    assert (reader.head, reader.dropped) == (8, 1)


def test_a_row_is_taken_one_poll_after_it_appeared(fd: int) -> None:
    writer, reader = RingWriter(fd, Row, wait=False), RingReader(fd)
    writer.put(row(0))
    assert reader.take() == b""
    writer.put(row(1))
    assert decode(reader.take()) == [row(0)]
    assert decode(reader.take()) == [row(1)]


@pytest.mark.parametrize("torn", [0, 3, 4])
def test_a_torn_row_is_an_error(fd: int, torn: int) -> None:
    writer, reader = RingWriter(fd, Row, wait=False), RingReader(fd)
    for n in range(5):
        writer.put(row(n))
    os.pwrite(fd, struct.pack("<q", 99), HEADER + (torn + 1) * SIZE - 8)
    writer.finish()
    with pytest.raises(TornRowError):
        reader.take()
    if torn == 4:
        assert reader.latest() is None


def test_an_observer_reads_the_newest_row_only(fd: int) -> None:
    writer, logger, bystander = RingWriter(fd, Row, wait=False), RingReader(fd), RingReader(fd)
    assert bystander.latest() is None
    for n in range(20):
        writer.put(row(n))
        newest = bystander.latest()
        assert newest is not None
        assert decode(newest) == [row(n)]
        logger.take()
        logger.commit()
    writer.finish()
    tail = logger.tail
    assert decode(logger.take()) == [row(n) for n in range(tail, 20)]


def test_a_second_writer_continues_after_the_first(fd: int) -> None:
    RingWriter(fd, Row, wait=False).put(row(0))
    second = RingWriter(fd, Row, wait=False)
    second.put(row(1))
    second.finish()
    assert decode(RingReader(fd).take()) == [row(0), row(1)]


def test_the_state_follows_the_producer(fd: int) -> None:
    reader = RingReader(fd)
    assert [state.value for state in ProducerState] == [0, 1, 2]
    assert reader.state == ProducerState.ABSENT
    writer = RingWriter(fd, Row, wait=False)
    assert reader.state == ProducerState.RUNNING
    writer.put(row(0))
    reader.mark_finished()
    assert reader.state == ProducerState.FINISHED
    assert decode(reader.take()) == [row(0)]


def test_a_ring_of_another_row_size_is_refused(fd: int) -> None:
    with pytest.raises(ValueError, match=f"rows of {SIZE} bytes, not 16"):
        RingWriter(fd, Inner, wait=False)


def test_a_file_that_is_not_a_ring_is_refused() -> None:
    other = os.memfd_create("other")
    os.ftruncate(other, HEADER)
    with pytest.raises(ValueError, match="not a ring"):
        RingReader(other)
    os.close(other)


PRODUCER = """
import sys
from test_core_ring import Row, row
from rig.recording.ring import RingWriter
writer, n = RingWriter(int(sys.argv[1]), Row, wait=True), 0
while True:
    writer.put(row(n))
    n += 1
"""


def test_a_killed_producer_loses_no_published_row() -> None:
    ring_fd = ring.create(Row, 64)
    process = start(PRODUCER, ring_fd)
    try:
        reader, got = RingReader(ring_fd), []
        deadline = time.monotonic() + 60
        while len(got) < 1000:
            got += decode(reader.take())
            reader.commit()
            assert time.monotonic() < deadline
        process.send_signal(signal.SIGKILL)
        process.wait(timeout=10)
        reader.mark_finished()
        head = reader.head
        while block := reader.take():
            got += decode(block)
        assert len(got) == head >= 1000
        assert got == [row(n) for n in range(head)]
    finally:
        process.kill()
        process.communicate()
        os.close(ring_fd)


def test_a_killed_reader_is_replaced() -> None:
    """The second reader continues after the rows committed by the first."""
    ring_fd = ring.create(Row, 64)
    try:
        writer = RingWriter(ring_fd, Row, wait=False)
        for n in range(30):
            writer.put(row(n))
        first = (
            "import sys, os, signal; from rig.recording.ring import RingReader;"
            "r = RingReader(int(sys.argv[1]));"
            "r.take(); r.take(10); r.commit(); r.take(5); os.kill(os.getpid(), signal.SIGKILL)"
        )
        process = start(first, ring_fd)
        process.communicate(timeout=60)
        assert process.returncode == -signal.SIGKILL
        writer.finish()
        assert decode(RingReader(ring_fd).take()) == [row(n) for n in range(10, 30)]
    finally:
        os.close(ring_fd)


def test_another_process_reads_the_same_bytes() -> None:
    ring_fd = ring.create(Row, 16)
    try:
        writer = RingWriter(ring_fd, Row, wait=False)
        for n in range(10):
            writer.put(row(n))
        writer.finish()
        code = (
            "import sys; from rig.recording.ring import RingReader; "
            "print(RingReader(int(sys.argv[1])).take().hex())"
        )
        assert decode(bytes.fromhex(output(code, ring_fd))) == [row(n) for n in range(10)]
    finally:
        os.close(ring_fd)


@pytest.mark.parametrize("count", [0, 1, 7, 8, 9, 16, 29])
def test_the_remaining_rows_are_the_newest_in_order(fd: int, count: int) -> None:
    writer, bystander = RingWriter(fd, Row, wait=False), RingReader(fd)
    logger = RingReader(fd)
    for number in range(count):
        writer.put(row(number))
        logger.take()
        logger.take()
        logger.commit()
    assert decode(bystander.remaining_rows()) == [row(n) for n in range(count)][-8:]


def test_the_ring_holds_the_utc_of_run_time_zero(fd: int) -> None:
    writer, reader = RingWriter(fd, Row, wait=False), RingReader(fd)
    assert reader.start_utc_ns == 0
    writer.start(1_760_000_000_123_456_789)
    assert RingReader(fd).start_utc_ns == reader.start_utc_ns == 1_760_000_000_123_456_789
