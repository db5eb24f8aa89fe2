"""One cycle of the bus and a torque axis on it: late, silent, garbled and restarted drives."""

from __future__ import annotations

import math

import pytest
from canopen_drives import MACHINE, OWN, SCALE, FakeLink, axis_settings
from drive_402 import Drive

from drivers.canopen import pdo
from drivers.canopen.bus_cycle import SYNC, BusCycle
from drivers.canopen.link import Frame
from drivers.canopen.torque_axis import TorqueAxis, layouts
from drivers.cia402 import scaling

NODE = 5
DT = 0.001
BEAT = 0.05
LAYOUTS = layouts(NODE, 2)
COMMAND, STATUS = LAYOUTS.command.cob_id, LAYOUTS.status.cob_id


class Bench:
    """A loop, an axis and a drive that answers each SYNC by the next tick."""

    def __init__(self) -> None:
        self.line = FakeLink()
        settings = axis_settings(
            NODE, analog=(0.5, 2.0), machine=MACHINE._replace(max_status_age=0.01)
        )
        self.axis = TorqueAxis(settings)
        self.bus = BusCycle(self.line, [self.axis], OWN, BEAT)
        self.drive = Drive()
        self.position = 0
        self.silent = False

    def tick(self, current: float = 0.0, enable: int = 0, count: int = 1) -> tuple[int, int]:
        """Tick; return the last controlword and raw torque that the drive received."""
        line, drive = self.line, self.drive
        for _ in range(count):
            now = self.bus.receive()
            self.bus.send([self.axis.command(current, enable, now)])
            word, torque = pdo.unpack(LAYOUTS.command, line.frames_of(COMMAND)[-1])
            drive.tick(word)
            if not self.silent:
                self.answer(torque if drive.state == "OE" else 0)
            line.time += DT
        return word, torque

    def answer(self, torque: int = 0) -> None:
        status = pdo.pack(LAYOUTS.status, self.drive.statusword, torque, self.position)
        slow = pdo.pack(
            LAYOUTS.slow, self.drive.mode_display, 0x3210 if self.drive.state == "F" else 0
        )
        self.line.incoming += [Frame(STATUS, status), Frame(LAYOUTS.slow.cob_id, slow)]

    @property
    def reading(self):  # type: ignore[no-untyped-def]
        return self.axis.read(self.line.now())

    def up(self) -> None:
        self.tick(count=3)
        self.tick(0.0, 1, count=10)
        assert self.reading.acting == 1


@pytest.fixture
def bench() -> Bench:
    return Bench()


def test_commands_go_out_before_their_sync_and_the_heartbeat_when_it_is_due(bench: Bench) -> None:
    bench.tick(count=120)
    cob_ids = [frame.cob_id for frame in bench.line.sent]
    assert cob_ids[:5] == [COMMAND, SYNC, 0x700 + OWN, COMMAND, SYNC]
    assert cob_ids.count(SYNC) == cob_ids.count(COMMAND) == 120
    assert bench.line.frames_of(0x700 + OWN) == [b"\x05"] * 3


def test_a_heartbeat_that_was_not_taken_is_tried_in_the_next_tick(bench: Bench) -> None:
    bench.line.refused_ids = frozenset({0x700 + OWN})
    bench.tick(count=5)
    bench.line.refused_ids = frozenset()
    bench.tick(count=5)
    assert len(bench.line.frames_of(0x700 + OWN)) == 1


def test_a_status_has_the_age_of_the_sync_that_asked_for_it(bench: Bench) -> None:
    assert bench.reading.age > 1e6
    assert bench.reading.analog_age > 1e6
    bench.tick(count=2)
    assert bench.bus.last_sync_time == pytest.approx(100.001)
    assert bench.reading.age == pytest.approx(2 * DT)


def test_a_sync_that_was_not_taken_makes_no_status_younger(bench: Bench) -> None:
    bench.tick()
    before = bench.bus.last_sync_time
    bench.line.refused_ids = frozenset({SYNC})
    bench.silent = True
    bench.tick(count=3)
    assert bench.bus.last_sync_time == before
    bench.answer()
    bench.bus.receive()
    assert bench.reading.age == pytest.approx(4 * DT)


def test_a_drive_enables_follows_and_disables(bench: Bench) -> None:
    bench.up()
    assert bench.tick(12.34, 1) == (0x0F, 1234)
    bench.bus.receive()
    assert bench.reading.current == pytest.approx(12.34)
    assert bench.tick(12.34, 0) == (0x00, 0)
    assert bench.reading.acting == 0
    bench.tick(12.34, 0, count=3)
    assert bench.drive.state == "SOD"


def test_each_rise_of_enable_is_one_request(bench: Bench) -> None:
    bench.up()
    bench.drive.state = "SOD"
    bench.tick(5.0, 1, count=50)
    assert bench.drive.state == "SOD", "it was disabled by itself and is not enabled again"
    assert bench.axis.explain() == "DROPPED"
    bench.tick(5.0, 0, count=3)
    assert bench.drive.state == "SOD"
    bench.tick(5.0, 1, count=10)
    assert bench.reading.acting == 1
    assert bench.axis.explain() == ""


def test_a_request_before_the_first_status_is_discarded(bench: Bench) -> None:
    bench.tick(5.0, 1, count=20)
    assert bench.drive.state == "SOD"
    assert bench.axis.explain() == "NOT_REQUESTED"
    bench.tick(5.0, 0)
    bench.tick(5.0, 1, count=10)
    assert bench.reading.acting == 1


@pytest.mark.parametrize("current", [math.nan, math.inf, -math.inf])
def test_a_nan_current_is_zero_and_flagged(current: float, bench: Bench) -> None:
    bench.up()
    assert bench.tick(current, 1) == (0x0F, 0)
    assert bench.axis.limit_flags == scaling.LimitFlag.NOT_FINITE
    assert bench.tick(1.0, 1) == (0x0F, 100)
    assert bench.axis.limit_flags == 0


@pytest.mark.parametrize(("current", "raw"), [(1e9, 4000), (-1e300, -4000), (40.001, 4000)])
def test_a_current_beyond_the_limit_is_clamped_and_flagged(
    current: float, raw: int, bench: Bench
) -> None:
    bench.up()
    assert bench.tick(current, 1) == (0x0F, raw)
    assert bench.axis.limit_flags == scaling.LimitFlag.SATURATED
    assert raw == math.copysign(SCALE.raw_limit, current)


def test_a_drive_that_falls_silent_loses_its_permission_and_does_not_get_it_back(
    bench: Bench,
) -> None:
    bench.up()
    bench.silent = True
    bench.tick(5.0, 1, count=9)
    assert bench.reading.acting == 1
    bench.tick(5.0, 1, count=5)
    assert bench.reading.acting == 0
    assert bench.axis.explain() == "STALE"
    assert pdo.unpack(LAYOUTS.command, bench.line.frames_of(COMMAND)[-1]) == (0, 0)
    bench.silent = False
    bench.tick(5.0, 1, count=50)
    assert bench.reading.acting == 0
    assert bench.drive.state == "SOD"


def test_a_drive_that_answers_two_ticks_late_is_still_steered(bench: Bench) -> None:
    late: list[list[Frame]] = [[], []]

    def tick(current: float, enable: int) -> tuple[int, int]:
        command = bench.tick(current, enable)
        late.append(bench.line.incoming)
        bench.line.incoming = late.pop(0)
        return command

    for _ in range(5):
        tick(0.0, 0)
    for _ in range(20):
        command = tick(7.0, 1)
    assert command == (0x0F, 700)
    assert bench.reading.acting == 1
    assert bench.reading.current == pytest.approx(7.0)
    for _ in range(5):
        command = tick(7.0, 0)
    assert bench.drive.state == "SOD"


def test_frames_of_a_wrong_length_are_refused_and_change_nothing(bench: Bench) -> None:
    bench.tick(count=3)
    before = bench.axis.read(0.0)
    for cob_id in (STATUS, LAYOUTS.slow.cob_id, LAYOUTS.analog.cob_id if LAYOUTS.analog else 0):
        for size in (0, 1, 7, 9):
            bench.line.incoming.append(Frame(cob_id, bytes([0x27] * size)))
    bench.line.incoming = [
        frame for frame in bench.line.incoming if frame.data[:1] in (b"\x27", b"")
    ]
    bench.bus.receive()
    assert bench.axis.refused == 12
    assert bench.axis.read(0.0) == before
    assert bench.bus.unexpected == 0


def test_unexpected_frames_are_counted(bench: Bench) -> None:
    bench.line.incoming = [Frame(0x185 + 1, b""), Frame(0x705, b"\x05")]
    bench.bus.receive()
    assert bench.bus.unexpected == 2


def test_a_restarted_drive_stays_down_and_its_counts_go_on(bench: Bench) -> None:
    bench.position = 2**31 - 10
    bench.up()
    bench.position = -(2**31) + 10  # it turned over
    bench.tick(1.0, 1, count=2)
    assert bench.reading.counts == 2**31 + 10
    bench.drive.state, bench.silent = "NR", True
    bench.tick(1.0, 1, count=20)
    bench.silent = False
    bench.tick(1.0, 1, count=50)
    assert bench.drive.state == "SOD"
    assert bench.reading.acting == 0
    assert bench.reading.error == 0
    assert bench.axis.explain() == "STALE"


def test_a_fault_is_reported_with_its_code_and_reset_on_request_only(bench: Bench) -> None:
    bench.up()
    bench.drive.fault()
    bench.tick(5.0, 1, count=5)
    assert bench.reading.error == 0x3210
    assert bench.reading.acting == 0
    bench.tick(5.0, 0, count=50)
    assert bench.drive.state == "F"
    bench.axis.reset()
    bench.tick(5.0, 1, count=20)
    assert bench.drive.state == "SOD", "reset, and not up by it"
    bench.tick(5.0, 1, count=50)
    assert bench.drive.state == "SOD"
    assert bench.reading.error == 0


def test_a_fault_without_a_code_has_one(bench: Bench) -> None:
    bench.tick(count=2)
    bench.drive.state = "F"
    bench.line.incoming = [Frame(STATUS, pdo.pack(LAYOUTS.status, bench.drive.statusword, 0, 0))]
    bench.bus.receive()
    assert bench.reading.error == 0xFFFF


def test_analog_inputs_are_scaled_and_have_their_own_age(bench: Bench) -> None:
    assert LAYOUTS.analog is not None
    bench.tick()
    bench.line.incoming.append(Frame(LAYOUTS.analog.cob_id, pdo.pack(LAYOUTS.analog, -100, 7)))
    bench.tick()
    assert bench.reading.analog == (-50.0, 14.0)
    bench.tick(count=5)
    assert bench.reading.age < 3 * DT < bench.reading.analog_age


def test_a_mode_that_is_not_shown_gives_no_torque(bench: Bench) -> None:
    bench.drive.mode_display = 1
    bench.tick(count=3)
    bench.tick(5.0, 1, count=20)
    assert bench.drive.state == "SO", "not enabled before the mode is shown"
    assert pdo.unpack(LAYOUTS.command, bench.line.frames_of(COMMAND)[-1])[1] == 0
    bench.drive.mode_display = 10
    bench.tick(5.0, 1, count=5)
    assert bench.reading.acting == 1


def test_closing_closes_the_line(bench: Bench) -> None:
    bench.bus.close()
    assert bench.line.closed
