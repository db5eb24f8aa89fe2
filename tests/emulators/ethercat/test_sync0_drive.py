"""A drive that works on SYNC0: when it takes outputs, what it refuses, what ends its OP."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from frame_master import FRMW, MS, OP, SAFEOP, STATION, FrameMaster, datagram, frame

from sim_plant.emulators.device_errors import SYNCHRONISATION

ERROR = ACKNOWLEDGE = 0x10
HALF = MS // 2
CONTROLWORD = 0x6040


class Sync0Master(FrameMaster):
    """A master whose frames pass half a cycle after SYNC0."""

    def __init__(self, *names: str) -> None:
        super().__init__(*names)
        self.reach_preop()
        for number in range(len(self.slaves)):
            self.write(number, 0x0920, 10**15 - self.read(number, 0x0910, 8), 8)
            assert self.download(number, 0x1C32, 1, b"\2\0") == 0

    def start_sync0(self, number: int = 0, *, cycle: int = MS, after: int = HALF) -> None:
        self.write(number, 0x0990, self.read(number, 0x0910, 8) + after, 8)
        self.write(number, 0x09A0, cycle, 4)
        assert self.write(number, 0x0981, 3, 1) == 1

    def tick(self, outputs: dict[int, bytes] | None = None) -> None:
        """Exchange process data and the reference time; half a cycle later SYNC0 comes."""
        self.send(FRMW, STATION | 0x0910 << 16, bytes(8))
        before = self.now
        self.cycle(outputs)
        assert self.now == before + MS

    def exchange(self) -> None:
        """Exchange process data; no time passes."""
        self.now -= MS
        self.cycle()

    def bring_to_op(self) -> None:
        self.reach_safeop()
        for number in range(len(self.slaves)):
            self.start_sync0(number)
        for _ in range(3):
            self.tick()
        for number in range(len(self.slaves)):
            assert self.request(number, OP) == (OP, 0)


def drive(*names: str) -> Sync0Master:
    master = Sync0Master("torque_drive", *names)
    master.bring_to_op()
    return master


def outputs(controlword: int, torque: int = 0) -> bytes:
    return struct.pack("<Hhbx", controlword, torque, 10)


def put(master: FrameMaster, number: int, data: bytes, arrived: int | None = None) -> None:
    """Send outputs of one slave without letting time pass."""
    at, octets, _, _ = master.areas[number]
    image = bytearray(master.image)
    image[at : at + octets] = data
    logical = datagram(12, 0x0001_0000, bytes(image))
    assert master.segment.process(frame(logical), arrived) is not None
    master.segment.finish_frame()


def pass_to(master: FrameMaster, time: int) -> None:
    master.now = time
    master.segment.poll(time)


def test_outputs_wait_for_sync0() -> None:
    master = drive()
    objects = master.slaves[0].objects
    begin = master.now
    put(master, 0, outputs(0x0006))
    pass_to(master, begin + HALF - 1000)
    assert objects.get(CONTROLWORD) == 0
    pass_to(master, begin + HALF)
    assert objects.get(CONTROLWORD) == 0x0006


def test_inputs_are_those_of_the_last_sync0() -> None:
    """A wheel that turns gives the same position to all frames between two pulses."""
    master = drive()
    for controlword in (0x06, 0x07, 0x0F, 0x0F, 0x0F, 0x0F):
        for _ in range(40):
            master.tick({0: outputs(controlword, 2000)})
    seen = []
    for _ in range(5):
        positions = set()
        for _ in range(3):
            put(master, 0, outputs(0x0F, 2000))
            positions.add(position(master))
            master.now += MS // 10
        assert len(positions) == 1
        seen += positions
        pass_to(master, master.now + HALF - 3 * MS // 10)
        pass_to(master, master.now + HALF)
    assert seen == sorted(seen)
    assert seen[-1] - seen[0] > 200  # counts: the world moves once a ms


def position(master: FrameMaster) -> int:
    """Read the drive's inputs; return its position."""
    _, _, at, _ = master.areas[0]
    data, counter = master.send(10, 0x0001_0000 + at, bytes(10))
    assert counter == 1
    return int(struct.unpack_from("<Hi", data)[1])


def test_a_frame_counts_when_it_arrives_not_when_it_is_read() -> None:
    """A busy host reads frames late; a controller on the wire sees them in time."""
    master = drive()
    objects, missed = master.slaves[0].objects, master.upload(0, 0x1C32, 0x0B)
    begin = master.now
    put(master, 0, outputs(0x0006), begin + HALF - 1000)
    master.now = begin + HALF + MS // 4  # read after SYNC0, which nobody has polled
    put(master, 0, outputs(0x0007), begin + HALF + 1000)
    assert objects.get(CONTROLWORD) == 0x0006
    pass_to(master, begin + HALF + MS)
    assert objects.get(CONTROLWORD) == 0x0007
    assert master.upload(0, 0x1C32, 0x0B) == missed


def test_a_frame_that_is_read_after_the_next_pulse_is_not_counted_twice() -> None:
    master = drive()
    before = master.upload(0, 0x1C32, 0x0B)
    begin = master.now
    pass_to(master, begin + HALF)  # a pulse without outputs
    put(master, 0, outputs(0x0006), begin + HALF - 1000)
    pass_to(master, begin + MS)
    assert master.upload(0, 0x1C32, 0x0B) - before == 1
    pass_to(master, begin + HALF + MS)
    assert master.slaves[0].objects.get(CONTROLWORD) == 0x0006
    assert master.upload(0, 0x1C32, 0x0B) - before == 1


def test_all_slaves_take_the_time_of_one_frame_at_one_moment() -> None:
    """However long the emulation takes from slave to slave."""
    master = drive("torque_drive")
    ticking = iter(range(0, 10**9, 200_000))  # each look at the clock takes 0.2 ms
    begin = master.now

    def slow_clock() -> int:
        return begin + next(ticking)

    for slave in master.slaves:
        slave.dc._clock = slow_clock
    master.segment.process(frame(datagram(FRMW, STATION | 0x0910 << 16, bytes(8))), begin)
    assert master.slaves[1].dc.difference() <= 500  # ns, the way from slave to slave


# ---- refusals of OP ------------------------------------------------------------------------------


def in_safeop(**settings: Any) -> Sync0Master:
    master = Sync0Master("torque_drive")
    master.reach_safeop()
    if settings:
        master.start_sync0(**settings)
    for _ in range(3):
        master.tick()
    return master


def test_without_its_sync_unit_op_is_refused() -> None:
    master = in_safeop()
    assert master.request(0, OP) == (SAFEOP | ERROR, 0x30)
    assert master.request(0, SAFEOP | ACKNOWLEDGE) == (SAFEOP, 0)
    master.start_sync0()
    master.tick()
    assert master.request(0, OP) == (OP, 0)


@pytest.mark.parametrize("cycle", [2 * MS, MS + 1, 0x40])
def test_another_cycle_than_that_of_the_object_is_refused(cycle: int) -> None:
    master = in_safeop(cycle=cycle)
    assert master.request(0, OP) == (SAFEOP | ERROR, 0x36)


def test_a_cycle_shorter_than_the_slave_can_is_refused() -> None:
    master = Sync0Master("torque_drive")
    assert master.download(0, 0x1C32, 2, struct.pack("<I", 200_000)) == 0
    master.reach_safeop()
    master.start_sync0(cycle=200_000)
    master.tick()
    assert master.request(0, OP) == (SAFEOP | ERROR, 0x36)


def test_op_waits_for_the_first_pulse_for_a_second() -> None:
    master = in_safeop(after=600 * MS)
    assert master.request(0, OP) == (SAFEOP, 0)
    for _ in range(590):
        master.tick()
    assert master.status(0) == (SAFEOP, 0)
    for _ in range(10):
        master.tick()
    assert master.status(0) == (OP, 0)
    late = in_safeop(after=5000 * MS)
    assert late.request(0, OP) == (SAFEOP, 0)
    for _ in range(1005):
        late.tick()
    assert late.status(0) == (SAFEOP | ERROR, 0x2D)


def test_a_clock_that_is_not_at_the_reference_is_refused() -> None:
    master = Sync0Master("torque_drive", "torque_drive")
    master.reach_safeop()
    for number in range(2):
        master.start_sync0(number)
    master.slaves[1].dc.jump(400_000)
    master.tick()
    assert master.request(0, OP) == (OP, 0)
    assert master.request(1, OP) == (SAFEOP, 0)  # until its clock has come to the reference
    for _ in range(30):
        master.tick()
    assert master.status(1) == (OP, 0)


def test_a_time_written_before_the_set_up_is_forgotten() -> None:
    """A master that clears 0x0910 of all slaves at its start resets the filters with 0x0930."""
    master = in_safeop(after=HALF)
    master.write(0, 0x0910, 0, 8)
    assert master.request(0, OP) == (SAFEOP, 0)
    assert master.slaves[0].missing() == 0x32
    master.write(0, 0x0930, 0x1000, 2)
    master.tick()
    assert master.status(0) == (OP, 0)


def test_the_type_of_synchronisation_changes_in_preop_only_and_to_supported_ones() -> None:
    master = Sync0Master("torque_drive")
    assert master.download(0, 0x1C32, 1, b"\3\0") == 0x0609_0030  # SYNC1
    assert master.download(0, 0x1C32, 1, b"\1\0") == 0
    master.reach_safeop()
    assert master.download(0, 0x1C32, 1, b"\2\0") == 0x0800_0022


# ---- the end of OP -------------------------------------------------------------------------------


def test_a_sync_unit_that_stops_ends_op() -> None:
    master = drive()
    for controlword in (0x06, 0x07, 0x0F):
        for _ in range(60):
            master.tick({0: outputs(controlword)})
    assert master.line.wheel is not None
    assert master.line.wheel.enabled == 1
    master.write(0, 0x0981, 0, 1)
    master.tick()
    assert master.status(0) == (SAFEOP | ERROR, 0x2C)
    master.pass_time(10)  # without SYNC0 the application runs every 4 ms
    assert master.line.wheel.enabled == 0
    assert SYNCHRONISATION in master.slaves[0].device.errors.active
    assert master.request(0, OP | ACKNOWLEDGE) == (SAFEOP | ERROR, 0x30)


def test_pulses_that_stay_away_end_op() -> None:
    master = drive()
    master.write(0, 0x0990, master.read(0, 0x0910, 8) + 100 * MS, 8)  # a new start time
    for _ in range(4):
        master.tick()
    assert master.status(0) == (SAFEOP | ERROR, 0x2C)


def test_the_fault_of_a_silent_sync_unit_ends_op_until_it_is_over() -> None:
    master = drive()
    master.slaves[0].inject("sync0_lost")
    for _ in range(4):
        master.tick()
    assert master.status(0) == (SAFEOP | ERROR, 0x2C)
    assert master.request(0, SAFEOP | ACKNOWLEDGE) == (SAFEOP, 0)
    assert master.request(0, OP) == (SAFEOP, 0)  # waits for a pulse
    master.slaves[0].clear("sync0_lost")
    master.tick()
    assert master.status(0) == (OP, 0)


@pytest.mark.parametrize(("missed", "state"), [(1, OP), (2, SAFEOP | ERROR)])
def test_pulses_without_new_outputs_end_op(missed: int, state: int) -> None:
    """Each adds 3 to a counter, of which a pulse with outputs takes 1; its limit is 4."""
    master = drive()
    before = master.upload(0, 0x1C32, 0x0B)
    master.pass_time(missed)
    assert master.status(0) == (state, 0x1A if state != OP else 0)
    assert master.slaves[0].objects.get(0x1C32, 0x0B) - before == missed
    assert master.slaves[0].objects.get(0x1C32, 0x20) == (state != OP)


def test_the_limit_of_misses_is_an_object() -> None:
    master = Sync0Master("torque_drive")
    assert master.download(0, 0x10F1, 2, struct.pack("<H", 150)) == 0
    master.bring_to_op()
    master.pass_time(50)
    assert master.status(0) == (OP, 0)
    master.pass_time(1)
    assert master.status(0) == (SAFEOP | ERROR, 0x1A)


def test_after_the_loss_op_begins_with_new_pulses_and_no_old_errors() -> None:
    master = drive()
    master.pass_time(20)
    assert master.status(0) == (SAFEOP | ERROR, 0x1A)
    assert master.request(0, SAFEOP | ACKNOWLEDGE) == (SAFEOP, 0)
    master.tick()
    assert master.request(0, OP) == (OP, 0)
    for _ in range(50):
        master.tick()
    assert master.status(0) == (OP, 0)


def test_a_clock_that_jumps_ends_op() -> None:
    master = drive("torque_drive")
    master.slaves[1].inject("dc_jump", 1_000_000)
    master.tick()
    assert master.status(0) == (OP, 0)
    assert master.status(1) == (SAFEOP | ERROR, 0x32)


def test_a_clock_that_drifts_stays_with_the_reference() -> None:
    master = drive("torque_drive")
    master.slaves[1].inject("dc_drift", 100.0)
    for _ in range(500):
        master.tick()
    assert master.status(1) == (OP, 0)
