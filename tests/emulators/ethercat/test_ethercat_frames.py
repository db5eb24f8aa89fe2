"""Frames and commands: octets by hand, working counters, addresses, malformed frames."""

from __future__ import annotations

import itertools
import struct

import pytest
from frame_master import (
    APRD,
    APRW,
    APWR,
    ARMW,
    BRD,
    BRW,
    BWR,
    FPRD,
    FPRW,
    FPWR,
    FRMW,
    LRD,
    LRW,
    LWR,
    MS,
    NOP,
    STATION,
    FrameMaster,
    datagram,
    frame,
)
from hypothesis import given
from hypothesis import strategies as st

from sim_plant.emulators.ethercat import datagrams
from sim_plant.emulators.ethercat.datagrams import FrameError

WATCHDOG = 0x0420  # a register that every slave lets the master write


def three() -> FrameMaster:
    master = FrameMaster("coupler", "digital_out:4", "digital_in:4")
    master.reach_preop()
    return master


def test_a_broadcast_read_octet_by_octet() -> None:
    """BRD of 0x0000, 2 octets, index 0x21: each slave adds 1 to address and counter."""
    master = three()
    sent = bytes.fromhex("ffffffffffff 101112131415 88a4 0e10 07 21 0000 0000 0200 0000 0000 0000")
    answer = master.segment.process(sent.ljust(60, b"\0"))
    assert answer is not None
    expected = bytes.fromhex("ffffffffffff 121112131415 88a4 0e10 07 21 0300 0000 0200 0000")
    assert answer[: len(expected)] == expected
    assert answer[26] == 0x11  # type of the controllers, ORed
    assert answer[28:30] == b"\x03\0"
    assert len(answer) == 60


@pytest.mark.parametrize(
    ("command", "place", "counter"),
    [
        (NOP, 0, 0), (APRD, -1, 1), (APWR, -1, 1), (APRW, -1, 3), (APRD, -3, 0), (APRD, 1, 0),
        (FPRD, STATION + 1, 1), (FPWR, STATION + 1, 1), (FPRW, STATION + 1, 3), (FPRD, 0x55, 0),
        (BRD, 0, 3), (BWR, 0, 3), (BRW, 0, 9), (ARMW, 0, 3), (ARMW, -2, 3),
        (FRMW, STATION, 3), (LRD, 0, 0), (LWR, 0, 0), (LRW, 0, 0),
    ],
)  # fmt: skip
def test_working_counters_of_registers(command: int, place: int, counter: int) -> None:
    master = three()
    data, got = master.send(command, place & 0xFFFF | WATCHDOG << 16, struct.pack("<H", 77))
    assert got == counter
    merged, reads = 1000 | 77, command in (APRD, APRW, FPRD, FPRW, ARMW, FRMW)
    seen = merged if command in (BRD, BRW) else 1000 if reads and counter else 77
    assert data == struct.pack("<H", seen)
    written = {
        (APWR, -1): {1: 77}, (APRW, -1): {1: 77}, (FPWR, STATION + 1): {1: 77},
        (FPRW, STATION + 1): {1: 77}, (BWR, 0): {0: 77, 1: 77, 2: 77},
        (BRW, 0): {0: 77, 1: merged, 2: merged},  # each writes what comes in
        (ARMW, -2): {0: 77, 1: 77},  # those ahead write what the master sent
    }.get((command, place), {})  # fmt: skip
    found = {number: master.read(number, WATCHDOG, 2) for number in range(3)}
    assert found == {0: 1000, 1: 1000, 2: 1000} | written


def test_read_multiple_write_gives_the_value_of_one_slave_to_those_behind() -> None:
    master = three()
    master.write(1, WATCHDOG, 321, 2)
    _, counter = master.send(FRMW, STATION + 1 | WATCHDOG << 16, bytes(2))
    assert counter == 3
    assert [master.read(number, WATCHDOG, 2) for number in range(3)] == [0, 321, 321]


def test_several_datagrams_of_a_frame_are_executed_in_order() -> None:
    master = three()
    sent = frame(
        datagram(FPWR, STATION | WATCHDOG << 16, b"\x07\0", 1, more=True),
        datagram(FPRD, STATION | WATCHDOG << 16, b"\0\0", 2, more=True),
        datagram(FPRD, 0x77 | WATCHDOG << 16, b"\0\0", 3),
    )
    answer = master.segment.process(sent)
    assert answer is not None
    assert [answer[at] for at in (17, 31, 45)] == [1, 2, 3]
    assert answer[16 + 14 + 10 : 16 + 14 + 14] == b"\x07\0\x01\0"
    assert answer[16 + 28 + 10 : 16 + 28 + 14] == b"\0\0\0\0"


@pytest.mark.parametrize(
    ("octets", "change"),
    [
        (12, b"\x08\x06"),  # another protocol
        (14, b"\x0e\x40"),  # another type of the EtherCAT header
        (14, b"\xff\x17"),  # longer than the frame
        (14, b"\x08\x10"),  # shorter than its datagram
        (16, b"\x55"),  # no such command
        (22, b"\x40\0"),  # a datagram longer than the frame
        (22, b"\x02\x80"),  # one more datagram, which is not there
    ],
)
def test_malformed_frames_are_dropped_and_counted(octets: int, change: bytes) -> None:
    master = three()
    good = frame(datagram(BRD, 0, b"\0\0"))
    before = master.segment.frames
    bad = good[:octets] + change + good[octets + len(change) :]
    assert master.segment.process(bad) is None
    assert master.segment.process(good[:20]) is None
    assert (master.segment.malformed, master.segment.frames) == (2, before)
    assert master.segment.process(good) is not None


@given(st.binary(max_size=120))
def test_any_octets_are_a_frame_or_an_error(data: bytes) -> None:
    head = b"\xff" * 12 + b"\x88\xa4"
    try:
        parsed = datagrams.parse(head + data)
    except FrameError:
        return
    total = sum(12 + len(each.data) for each in parsed)
    assert total <= len(data) - 2
    rebuilt = datagrams.build(parsed, b"\xff" * 6, b"\xff" * 6)
    assert rebuilt[16 : 16 + total] == data[2 : 2 + total]


def test_without_a_slave_no_frame_returns() -> None:
    master = three()
    master.slaves[1].inject("unplugged")
    assert master.send(BRD, 0, b"\0\0")[1] == 1  # the first one is there, all behind are not
    master.slaves[0].inject("unplugged")
    assert master.send(BRD, 0, b"\0\0")[1] == -1
    for slave in master.slaves[:2]:
        slave.clear("unplugged")
    assert master.send(BRD, 0, b"\0\0")[1] == 3
    assert master.send(FPRD, STATION | 0x0010 << 16, b"\0\0")[1] == 0  # lost with the power


def test_ports_show_the_end_of_the_line() -> None:
    """0x0110: port 0 open, port 1 open or closed, ports 2 and 3 closed."""
    master = three()
    assert [master.read(n, 0x0110, 2) & 0xFF00 for n in range(3)] == [0x5A00, 0x5A00, 0x5600]
    master.slaves[0].inject("cable_cut")
    assert master.read(0, 0x0110, 2) & 0xFF00 == 0x5600
    assert master.send(BRD, 0, b"\0\0")[1] == 1
    master.slaves[0].clear("cable_cut")
    assert master.read(2, 0x0130, 2) == 2  # it kept power and state


def test_slaves_change_places() -> None:
    master = three()
    master.segment.inject("order_swapped", 1)
    assert [int.from_bytes(master.send(APRD, -n & 0xFFFF | 0x10 << 16, bytes(2))[0], "little")
            for n in range(3)] == [STATION, STATION + 2, STATION + 1]  # fmt: skip
    master.segment.clear("order_swapped")
    with pytest.raises(ValueError, match="place 2 is not within 0 to 1"):
        master.segment.inject("order_swapped", 2)
    with pytest.raises(ValueError, match="no fault 'gremlin'"):
        master.segment.inject("gremlin")


def test_port_times_give_the_delay_of_each_cable() -> None:
    """By the rule of masters: half the differences of the loop times of neighbours."""
    master = FrameMaster("torque_drive", "analog_in", "encoder")
    master.reach_preop()
    master.now += 3 * MS
    assert master.send(BWR, 0x0900 << 16, bytes(4))[1] == 3
    loops = []
    for number in range(3):
        first, second = master.read(number, 0x0900, 4), master.read(number, 0x0904, 4)
        loops.append(second - first if second else 0)
        assert master.read(number, 0x0918, 8) & 0xFFFFFFFF == first
    assert [(a - b) // 2 for a, b in itertools.pairwise(loops)] == [500, 500]
