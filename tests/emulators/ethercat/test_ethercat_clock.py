"""The distributed clock: offset, drift, jump, pulses of SYNC0."""

from __future__ import annotations

import pytest
from frame_master import FRMW, MS, STATION, FrameMaster


def two() -> FrameMaster:
    master = FrameMaster("torque_drive", "encoder")
    master.reach_preop()
    return master


def times(master: FrameMaster) -> list[int]:
    return [master.read(number, 0x0910, 8) for number in range(2)]


def align(master: FrameMaster) -> None:
    """Offset and delay of both clocks to the same system time."""
    for number in range(2):
        master.write(number, 0x0920, 10**15 - master.read(number, 0x0910, 8), 8)


def follow(master: FrameMaster, cycles: int) -> int:
    """Send FRMW 0x0910 each ms; return the difference of the second clock, from the registers."""
    for _ in range(cycles):
        _, counter = master.send(FRMW, STATION | 0x0910 << 16, bytes(8))
        assert counter == 2
        master.now += MS
    raw = master.read(1, 0x092C, 4)
    return (raw & 0x7FFFFFFF) * (1 if raw >> 31 else -1)


def test_system_time_is_local_time_and_offset() -> None:
    master = two()
    before = times(master)
    master.write(0, 0x0920, 12345, 8)
    assert times(master)[0] - before[0] == 12345
    master.now += 7 * MS
    assert times(master)[0] - before[0] == 12345 + 7 * MS
    master.write(0, 0x0920, -before[0] & (1 << 64) - 1, 8)
    assert times(master)[0] == 7 * MS


def test_a_clock_that_drifts_is_pulled_to_the_reference() -> None:
    """100 ppm is 100 ns a ms; a loop that removes an eighth of the difference leaves 800 ns."""
    master = two()
    align(master)
    assert abs(times(master)[1] - times(master)[0]) <= 1000
    master.slaves[1].inject("dc_drift", 100.0)
    drifted = times(master)
    master.now += 1000 * MS
    assert times(master)[1] - drifted[1] == pytest.approx(1000 * MS + 100_000, abs=1)
    assert times(master)[0] - drifted[0] == 1000 * MS
    assert follow(master, 200) == pytest.approx(800, rel=0.05)
    master.slaves[1].clear("dc_drift")
    assert abs(follow(master, 200)) <= 1


def test_a_jump_is_seen_and_removed() -> None:
    master = two()
    align(master)
    follow(master, 100)
    before = times(master)[1]
    master.slaves[1].inject("dc_jump", 1_000_000)
    assert times(master)[1] - before == 1_000_000
    assert follow(master, 1) == pytest.approx(1_000_000, abs=600)
    assert abs(follow(master, 200)) <= 1


def test_sync0_starts_at_its_time_and_counts() -> None:
    master = two()
    align(master)
    dc = master.slaves[0].dc
    start = times(master)[0] + 100 * MS
    master.write(0, 0x0990, start, 8)
    master.write(0, 0x09A0, MS, 4)
    assert (dc.sync0_cycle(), dc.sync0_count()) == (0, 0)
    master.write(0, 0x0981, 3, 1)
    assert (dc.sync0_cycle(), dc.sync0_count()) == (MS, 0)
    master.now += 100 * MS
    assert dc.sync0_count() == 1
    master.now += 10 * MS + 1
    assert dc.sync0_count() == 11
