"""The actuator's conversation: completed, halted and failed moves; none repeats by itself."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
from canopen_drives import MACHINE, FakeLink, actuator_settings
from drive_402 import Drive

from drivers.canopen import pdo
from drivers.canopen.bus_cycle import BusCycle
from drivers.canopen.link import Frame
from drivers.canopen.position_actuator import PositionActuator
from drivers.cia402 import profile_position as move
from drivers.cia402 import scaling
from drivers.cia402.positioning_drive import PositioningReading
from drivers.cia402.state_table import HALT
from drivers.cia402.statusword import MODE_BIT_12, MODE_BIT_13, TARGET_REACHED

NODE = 9
DT = 0.01
COMMAND = pdo.layout(0x209, pdo.ACTUATOR_COMMAND)
TARGET = pdo.layout(0x309, pdo.ACTUATOR_TARGET)
STATUS = pdo.layout(0x189, pdo.ACTUATOR_STATUS)
STEP = 300  # counts a tick


class Positioner(Drive):
    """A drive that accepts set-points by the handshake of bits 4 and 12, and moves to them."""

    def __init__(self) -> None:
        super().__init__()
        self.mode_display = move.MODE
        self.counts = self.goal = 1000  # our 0
        self.taken: list[int] = []
        self.blocked = False
        self.deaf = False  # to new set-points

    def moved(self, word: int, target: int) -> None:
        rising = word & ~self.last & move.NEW_SET_POINT
        self.tick(word)
        if self.state != "OE":
            self.goal, self.bits = self.counts, 0
            return
        if rising and not self.deaf and not word & HALT:
            self.goal = target
            self.taken.append(target)
            self.bits |= MODE_BIT_12
        if not word & move.NEW_SET_POINT:
            self.bits &= ~MODE_BIT_12
        if not (word & HALT or self.blocked):
            distance = self.goal - self.counts
            self.counts += max(-STEP, min(STEP, distance))
        arrived = self.counts == self.goal
        self.bits = self.bits | TARGET_REACHED if arrived else self.bits & ~TARGET_REACHED


class Bench:
    """A loop with one actuator."""

    def __init__(self) -> None:
        self.line = FakeLink()
        settings = actuator_settings(NODE, machine=MACHINE._replace(max_status_age=0.1))
        self.actuator = PositionActuator(settings)
        self.bus = BusCycle(self.line, [self.actuator], 127, 1.0)
        self.drive = Positioner()
        self.silent = False

    def tick(self, target: float, enable: int = 1, count: int = 1, release: bool = False) -> None:
        line, drive = self.line, self.drive
        for _ in range(count):
            now = self.bus.receive()
            if release:
                self.bus.send(self.actuator.release(now))
            else:
                self.bus.send(self.actuator.command(target, enable, now))
            self.word, mode = pdo.unpack(COMMAND, line.frames_of(COMMAND.cob_id)[-1])
            assert mode == move.MODE
            drive.moved(self.word, pdo.unpack(TARGET, line.frames_of(TARGET.cob_id)[-1])[0])
            if not self.silent:
                data = pdo.pack(STATUS, drive.statusword, drive.mode_display, drive.counts)
                line.incoming.append(Frame(STATUS.cob_id, data))
            line.time += DT

    def until(
        self, true: Callable[[PositioningReading], object], target: float, enable: int = 1
    ) -> None:
        for _ in range(300):
            if true(self.reading):
                return
            self.tick(target, enable)
        raise AssertionError(f"in vain: {self.reading}, {self.actuator.explain()}")

    @property
    def reading(self) -> PositioningReading:
        return self.actuator.read(self.line.now())


@pytest.fixture
def bench() -> Bench:
    one = Bench()
    one.tick(0.0, 0, count=3)
    assert one.drive.state == "SOD", "not requested yet"
    return one


def arrived(reading: PositioningReading) -> bool:
    return reading.arrived == 1


def failed(reading: PositioningReading) -> bool:
    return reading.failed != 0


def test_the_first_target_enables_moves_and_arrives(bench: Bench) -> None:
    bench.until(arrived, 20.0)
    assert bench.reading.position == pytest.approx(20.0)
    assert bench.drive.taken == [3000]
    bench.tick(20.0, count=50)
    assert bench.drive.taken == [3000], "one target is offered once"
    bench.tick(-5.0)
    assert bench.reading.arrived == 0
    bench.until(arrived, -5.0)
    assert bench.drive.taken == [3000, 500]


def test_the_target_is_sent_before_its_controlword(bench: Bench) -> None:
    bench.until(arrived, 20.0)
    order = [frame.cob_id for frame in bench.line.sent if frame.cob_id in (0x209, 0x309)]
    assert order == [0x309, 0x209] * (len(order) // 2)
    assert pdo.unpack(TARGET, bench.line.frames_of(0x309)[0]) == (0, 50)


def test_a_new_target_during_a_move_is_accepted_at_once(bench: Bench) -> None:
    bench.until(lambda reading: reading.position > 10.0, 60.0)
    bench.until(arrived, 5.0)
    assert bench.drive.taken == [7000, 1500]
    assert bench.reading.position == pytest.approx(5.0)


def test_halt_stops_it_and_the_same_target_goes_on(bench: Bench) -> None:
    bench.until(lambda reading: reading.position > 10.0, 60.0)
    bench.tick(60.0, 0, count=20)
    halted_at = bench.reading.position
    assert 10.0 < halted_at < 40.0
    assert bench.word & HALT
    assert bench.drive.state == "OE", "it holds its place under power"
    assert bench.reading.failed == move.Failure.HALTED
    bench.tick(60.0, 0, count=20)
    assert bench.reading.position == halted_at
    bench.until(arrived, 60.0)
    assert bench.drive.taken == [7000, 7000]
    assert bench.reading.position == pytest.approx(60.0)
    assert not bench.word & HALT


def test_a_failed_move_is_not_repeated_by_itself(bench: Bench) -> None:
    bench.drive.blocked = True
    bench.until(failed, 20.0)
    assert bench.reading.failed == move.Failure.LATE_ARRIVAL
    bench.drive.blocked = False
    bench.tick(20.0, count=300)
    assert bench.drive.taken == [3000]
    assert bench.reading.failed == move.Failure.LATE_ARRIVAL
    assert bench.word & HALT
    bench.until(arrived, 30.0)
    assert bench.drive.taken == [3000, 4000], "another target is"


def test_a_failed_move_is_repeated_after_a_halt(bench: Bench) -> None:
    bench.drive.deaf = True
    bench.until(failed, 20.0)
    assert bench.reading.failed == move.Failure.LATE_TAKEN
    bench.drive.deaf = False
    bench.tick(20.0, 0, count=2)
    bench.until(arrived, 20.0)
    assert bench.drive.taken == [3000]


def test_a_following_error_ends_the_move(bench: Bench) -> None:
    bench.until(lambda reading: reading.position > 10.0, 60.0)
    bench.drive.bits |= MODE_BIT_13
    bench.until(failed, 60.0)
    assert bench.reading.failed == move.Failure.FOLLOWING_ERROR


@pytest.mark.parametrize("target", [math.nan, math.inf, -math.inf])
def test_a_nan_target_halts_and_is_not_sent(target: float, bench: Bench) -> None:
    bench.tick(target, count=5)
    assert bench.drive.state == "SOD", "nor does it bring it up"
    bench.until(lambda reading: reading.position > 10.0, 60.0)
    bench.tick(target, count=20)
    assert bench.word & HALT
    assert bench.reading.failed == move.Failure.HALTED
    assert bench.drive.taken == [7000]
    bench.until(arrived, 60.0)


def test_a_target_beyond_the_limits_is_clamped_and_not_reached(bench: Bench) -> None:
    bench.tick(500.0, count=200)
    assert bench.drive.counts == 9000
    assert bench.reading.position == pytest.approx(80.0)
    assert bench.reading.arrived == 0, "80 is not 500"
    assert bench.reading.failed == 0
    assert bench.actuator.limit_flags == scaling.LimitFlag.SATURATED
    bench.until(arrived, 80.05)  # as near as the window
    assert bench.drive.taken[-1] == 9000


def test_release_removes_power_and_the_next_target_requests_it_again(bench: Bench) -> None:
    bench.until(arrived, 20.0)
    bench.tick(0.0, release=True, count=5)
    assert bench.drive.state == "SOD"
    assert bench.word == 0
    assert bench.reading.arrived == 0
    bench.until(arrived, 20.0)
    assert bench.drive.taken == [3000, 3000]


def test_a_dropped_drive_is_not_enabled_by_the_same_request(bench: Bench) -> None:
    bench.until(lambda reading: reading.position > 10.0, 60.0)
    bench.drive.state = "SOD"
    bench.tick(60.0, count=100)
    assert bench.drive.state == "SOD"
    assert bench.actuator.explain() == "DROPPED"
    assert bench.reading.failed == move.Failure.NOT_ACTING
    bench.tick(60.0, release=True, count=5)
    bench.until(arrived, 60.0)


def test_a_silent_actuator_ages_and_stays_disabled_on_return(bench: Bench) -> None:
    bench.until(arrived, 20.0)
    bench.silent = True
    bench.tick(20.0, count=20)
    assert bench.reading.age == pytest.approx(0.2, abs=0.03)
    assert bench.actuator.explain() == "STALE"
    assert bench.reading.arrived == 0
    bench.silent = False
    bench.tick(20.0, count=50)
    assert bench.drive.state == "SOD"
    assert bench.reading.arrived == 0


def test_a_fault_is_reported(bench: Bench) -> None:
    bench.until(arrived, 20.0)
    bench.drive.fault()
    bench.tick(20.0, count=5)
    assert (bench.reading.fault, bench.reading.arrived) == (1, 0)
    assert bench.actuator.explain() == "FAULT"


def test_frames_of_a_wrong_length_are_refused(bench: Bench) -> None:
    before = bench.actuator.read(0.0)
    for size in (0, 1, 6, 8):
        bench.line.incoming = [Frame(STATUS.cob_id, bytes(size))]
        bench.bus.receive()
    assert bench.actuator.refused == 4
    assert bench.actuator.read(0.0) == before
