"""The loop's link drains all its frames at once, and ages are never too small."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import can
import pytest

from drivers.canopen.bus_cycle import SYNC, BusCycle
from drivers.canopen.bus_settings import BusSettings
from drivers.canopen.link import Link

COB_ID, OTHER = 0x185, 0x07F


@pytest.fixture
def line() -> Iterator[Link]:
    link = Link(BusSettings("virtual", "link test", 1_000_000, ()), (COB_ID,))
    yield link
    link.close()


@pytest.fixture
def far() -> Iterator[Any]:
    with can.Bus(interface="virtual", channel="link test") as bus:
        yield bus


def send(far: Any, cob_id: int, *data: int, extended: bool = False) -> None:
    far.send(can.Message(arbitration_id=cob_id, data=bytes(data), is_extended_id=extended))


def test_frames_of_other_ids_do_not_end_a_drain(line: Link, far: Any) -> None:
    for number in range(5):
        send(far, OTHER, 0, 0)
        send(far, COB_ID, number)
        send(far, COB_ID, 99, extended=True)
    assert [data[0] for _, data in line.drain()] == [0, 1, 2, 3, 4]
    assert not line.has_backlog
    assert line.drain() == []


def test_an_incomplete_drain_reports_a_backlog(line: Link, far: Any) -> None:
    for _ in range(10):
        send(far, OTHER)
    assert line.drain(max_frames=4) == []
    assert line.has_backlog
    line.drain()
    assert not line.has_backlog


class Recorder:
    """A node that records the SYNC times passed to it."""

    sync_dividers: ClassVar = {COB_ID: 1}

    def __init__(self) -> None:
        self.sync_times: list[float] = []

    def receive(self, cob_id: int, data: bytes, sampled: float) -> None:
        self.sync_times.append(sampled)


class Backlog:
    """A link that receives more frames than one drain returns."""

    def __init__(self) -> None:
        self.has_backlog = False
        self.time = 0.0
        self.sent: list[int] = []

    def now(self) -> float:
        self.time += 0.001
        return self.time

    def send(self, frames: Sequence[tuple[int, bytes]]) -> Sequence[int]:
        self.sent += [cob_id for cob_id, _ in frames]
        return ()

    def drain(self) -> list[Any]:
        return [(COB_ID, b"")]

    def close(self) -> None:
        pass


def test_frames_of_a_link_with_backlog_age() -> None:
    line, listener = Backlog(), Recorder()
    cycle = BusCycle(line, (listener,), 127, 0.05)
    cycle.receive()
    cycle.send(())
    line.has_backlog = True
    answered = []
    for _ in range(4):
        cycle.receive()
        cycle.send(())
        answered.append(cycle.last_sync_time)
    assert len(set(listener.sync_times[1:])) == 1  # as old as when it fell behind
    line.has_backlog = False
    cycle.receive()
    assert listener.sync_times[-1] == answered[-1]
    assert SYNC in line.sent
