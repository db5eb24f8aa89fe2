"""The loop's end of a bus: emptied in one look whatever else is on it, and never told too young."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import can
import pytest

from drivers.canopen.bus_cycle import SYNC, BusCycle
from drivers.canopen.bus_settings import Bus
from drivers.canopen.link import Link

WANTED, OTHER = 0x185, 0x07F


@pytest.fixture
def line() -> Iterator[Link]:
    link = Link(Bus("virtual", "link test", 1_000_000, ()), (WANTED,))
    yield link
    link.close()


@pytest.fixture
def far() -> Iterator[Any]:
    with can.Bus(interface="virtual", channel="link test") as bus:
        yield bus


def send(far: Any, cob_id: int, *data: int, extended: bool = False) -> None:
    far.send(can.Message(arbitration_id=cob_id, data=bytes(data), is_extended_id=extended))


def test_frames_nobody_wants_do_not_end_a_look(line: Link, far: Any) -> None:
    for number in range(5):
        send(far, OTHER, 0, 0)
        send(far, WANTED, number)
        send(far, WANTED, 99, extended=True)
    assert [data[0] for _, data in line.drain()] == [0, 1, 2, 3, 4]
    assert not line.behind
    assert line.drain() == []


def test_a_look_that_leaves_something_says_so(line: Link, far: Any) -> None:
    for _ in range(10):
        send(far, OTHER)
    assert line.drain(most=4) == []
    assert line.behind
    line.drain()
    assert not line.behind


class Listener:
    """A node that notes when what it was given is said to be sampled."""

    each_sync: ClassVar = {WANTED: 1}

    def __init__(self) -> None:
        self.sampled: list[float] = []

    def take(self, cob_id: int, data: bytes, sampled: float) -> None:
        self.sampled.append(sampled)


class Backlog:
    """A line on which more comes than a look takes."""

    def __init__(self) -> None:
        self.behind = False
        self.time = 0.0
        self.sent: list[int] = []

    def now(self) -> float:
        self.time += 0.001
        return self.time

    def send(self, cob_id: int, data: bytes) -> bool:
        self.sent.append(cob_id)
        return True

    def drain(self) -> list[Any]:
        return [(WANTED, b"")]

    def close(self) -> None:
        pass


def test_frames_of_a_line_that_is_behind_grow_old() -> None:
    line, listener = Backlog(), Listener()
    cycle = BusCycle(line, (listener,), 127, 0.05)
    cycle.receive()
    cycle.send(())
    line.behind = True
    answered = []
    for _ in range(4):
        cycle.receive()
        cycle.send(())
        answered.append(cycle.synced)
    assert len(set(listener.sampled[1:])) == 1  # as old as when it fell behind
    line.behind = False
    cycle.receive()
    assert listener.sampled[-1] == answered[-1]
    assert SYNC in line.sent
