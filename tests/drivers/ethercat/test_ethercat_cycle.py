"""A cycle over wires that lose, delay, repeat and hold back frames: ages are always true."""

from __future__ import annotations

import struct
from collections.abc import Iterable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.ethercat.cycle import OPERATIONAL, SegmentCycle
from drivers.ethercat.frames import Command, CyclicFrame, Datagram, decode, encode

SIZE, WKC, SLAVES, TICK = 8, 9, 3, 0.001


class Segment:
    """Slaves on a wire; each input is the number of the tick in which the slaves saw the frame."""

    def __init__(self) -> None:
        self.frame = bytearray(1518)
        self.time = 100.0
        self.wkc = WKC
        self.accepts = True
        self.closed = False
        self.answers: list[bytes] = []  # on their way back
        self.arrived: list[bytes] = []

    def now(self) -> float:
        return self.time

    def send(self, frame: bytearray) -> bool:
        if not self.accepts:
            return False
        data, status, number, *clock = decode(bytes(frame))
        seen = struct.pack("<d", self.time)
        al_status = struct.pack("<H", OPERATIONAL)
        self.answers.append(
            encode(
                (
                    data._replace(data=seen, wkc=self.wkc),
                    status._replace(data=al_status, wkc=SLAVES),
                    number,
                    *clock,
                )
            )
        )
        return True

    def receive(self) -> int:
        if not self.arrived:
            return 0
        frame = self.arrived.pop(0)
        self.frame[: len(frame)] = frame
        return len(frame)

    def close(self) -> None:
        self.closed = True

    def deliver(self, places: Iterable[int]) -> None:
        """Let answers arrive, by their places among those on their way."""
        chosen = list(places)
        self.arrived += [self.answers[place] for place in chosen]
        self.answers = [each for i, each in enumerate(self.answers) if i not in chosen]

    def deliver_all(self) -> None:
        self.deliver(range(len(self.answers)))


def make() -> tuple[Segment, SegmentCycle]:
    segment = Segment()
    return segment, SegmentCycle(segment, CyclicFrame(SIZE, None), WKC)


def seen(cycle: SegmentCycle) -> float:
    """Time at which the slaves sampled the inputs."""
    (value,) = struct.unpack("<d", cycle.inputs)
    return float(value)


def test_inputs_are_one_tick_old() -> None:
    segment, cycle = make()
    for _ in range(1000):
        now = cycle.receive()
        assert now == segment.time
        cycle.outputs[:] = bytes(range(SIZE))
        cycle.send()
        assert cycle.sampled in (seen(cycle), -1e9)
        segment.time += TICK
        segment.deliver_all()
    cycle.receive()
    assert cycle.sampled == seen(cycle) == pytest.approx(segment.time - TICK)
    assert cycle.state == (WKC, SLAVES, OPERATIONAL, 0, cycle.sampled)
    assert (cycle.wrong_wkc, cycle.lost, cycle.late, cycle.foreign) == (0, 0, 0, 0)


@pytest.mark.parametrize("ticks", [1, 5, 25, 300, 2000])
def test_after_a_stall_of_the_wire_the_newest_answer_counts_at_once(ticks: int) -> None:
    """More answers than there are indices may wait: each has its frame's number."""
    segment, cycle = make()
    for _ in range(ticks):
        cycle.receive()
        cycle.send()
        segment.time += TICK
    segment.deliver_all()
    for _ in range(1 + ticks // 256):  # one look takes 256 frames at most
        cycle.receive()
    assert cycle.sampled == seen(cycle) == pytest.approx(segment.time - TICK)
    assert cycle.lost == 0


def test_inputs_with_a_wrong_working_counter_age() -> None:
    segment, cycle = make()
    cycle.send()
    segment.deliver_all()
    cycle.receive()
    before = cycle.sampled
    segment.wkc = WKC - 3  # a slave did not see the frame
    for _ in range(10):
        segment.time += TICK
        cycle.send()
        segment.deliver_all()
        cycle.receive()
    assert cycle.sampled == before == seen(cycle)
    assert cycle.wrong_wkc == 10
    assert cycle.state.wkc == WKC - 3
    segment.wkc = WKC
    segment.time += TICK
    cycle.send()
    segment.deliver_all()
    cycle.receive()
    assert cycle.sampled == segment.time == seen(cycle)


def test_frames_that_are_not_ours_and_frames_that_are_not_sent() -> None:
    segment, cycle = make()
    segment.arrived = [encode((Datagram(Command.BRD, 20, 0, bytes(2)),)), bytes(60), b"\0"]
    cycle.receive()
    assert cycle.foreign == 3
    segment.accepts = False
    cycle.send()
    segment.accepts = True
    segment.time += TICK
    cycle.send()
    segment.deliver_all()
    cycle.receive()
    assert cycle.sampled == segment.time
    assert cycle.lost == 0
    cycle.close()
    assert segment.closed


@given(st.lists(st.tuples(st.sampled_from(["keep", "lose", "twice", "all"]), st.integers(0, 30))))
def test_ages_are_true_whatever_happens_to_the_answers(
    events: list[tuple[str, int]],
) -> None:
    segment, cycle = make()
    newest = -1e9
    for event, place in events:
        cycle.send()
        segment.time += TICK
        count = len(segment.answers)
        if event == "lose":
            segment.answers.pop(place % count)
        elif event == "twice":
            answer = segment.answers[place % count]
            segment.arrived += [answer, answer]
        elif event == "all":
            segment.deliver_all()
        cycle.receive()
        if cycle.sampled > -1e9:
            assert cycle.sampled == seen(cycle)  # the true time of the inputs
        assert cycle.sampled >= newest  # never older ones in place of newer ones
        newest = cycle.sampled
