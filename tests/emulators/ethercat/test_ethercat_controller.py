"""Sync managers and FMMUs of a slave controller; logical commands."""

from __future__ import annotations

import struct

import pytest
from frame_master import FPRD, FPWR, LOGICAL, LRD, LRW, LWR, FrameMaster
from hypothesis import given, settings
from hypothesis import strategies as st
from random_examples import examples

from sim_plant.emulators.ethercat import fmmu
from sim_plant.emulators.ethercat.controller import SlaveController


def controller(*managers: bytes) -> SlaveController:
    built = SlaveController(has_dc=False)
    for number, registers in enumerate(managers):
        assert built.write(0x0800 + 8 * number, registers)
    return built


OUT = bytes.fromhex("0010 0800 26 00 01 00")  # mailbox of 8 octets at 0x1000, written by the master
IN = bytes.fromhex("0820 0800 22 00 01 00")  # one at 0x2008, read by it
BUFFER_OUT = bytes.fromhex("0011 0400 64 00 01 00")
BUFFER_IN = bytes.fromhex("0018 0400 20 00 01 00")


def test_a_mailbox_is_full_at_its_last_octet_and_refuses_more() -> None:
    c = controller(OUT, IN)
    assert c.read(0x0805, 1) == b"\0"
    assert not c.write(0x1004, b"late")  # not from its first octet
    assert c.write(0x1000, b"head")
    assert c.read(0x0805, 1) == b"\0"
    assert c.write(0x1004, b"tail")
    assert c.read(0x0805, 1) == b"\x08"
    assert not c.write(0x1000, b"headtail")
    assert c.sync_managers[0].latest == b"headtail"
    assert c.read(0x1000, 8) is None  # it is the master's to write
    c.sync_managers[0].release()
    assert c.write(0x1000, b"headtail")
    assert not c.write(0x0FFE, b"outside")


def test_a_read_mailbox_empties_at_its_last_octet() -> None:
    c = controller(OUT, IN)
    assert c.read(0x2008, 8) is None
    c.sync_managers[1].put(b"answer")
    assert c.read(0x080D, 1) == b"\x08"
    assert c.read(0x2008, 4) == b"answ"
    assert c.read(0x080D, 1) == b"\x08"
    assert c.read(0x200C, 4) == b"er\0\0"
    assert c.read(0x080D, 1) == b"\0"
    assert c.read(0x2008, 8) is None
    assert not c.write(0x2008, b"12345678")


def test_process_data_changes_as_a_whole() -> None:
    c = controller(BUFFER_OUT, BUFFER_IN)
    out, in_ = c.sync_managers[:2]
    assert c.read(0x0805, 1) == b"\x30"  # no buffer written
    assert c.write(0x1100, b"abcd")
    assert c.read(0x0805, 1) == b"\0"
    assert c.write(0x1100, b"xy")
    assert out.latest == b"abcd"
    assert c.write(0x1102, b"zw")
    assert out.latest == b"xyzw"
    in_.put(b"old.")
    assert c.read(0x1800, 2) == b"ol"
    in_.put(b"new!")
    assert c.read(0x1802, 2) == b"d."
    assert c.read(0x1800, 4) == b"new!"


def test_the_status_of_a_sync_manager_is_read_only() -> None:
    c = controller(OUT)
    assert c.write(0x0805, b"\x08") is False
    assert c.write(0x0800, bytes.fromhex("0010 0800 26 ff 01 ff"))
    assert c.read(0x0805, 3) == b"\0\x01\0"


def test_an_access_from_registers_into_process_memory_is_refused() -> None:
    """It would pass the sync managers; the controller has nothing that spans the border."""
    (slave,) = FrameMaster("torque_drive").slaves
    assert slave.controller.read(0x0FF8, 16) is None
    assert slave.controller.write(0x0FF8, bytes(16)) is False
    assert slave.controller.read(0x0FF8, 8) == bytes(8)


def test_watchdog_defaults_and_counts() -> None:
    c = SlaveController(has_dc=True)
    assert [c.get(address, 2) for address in (0x0400, 0x0410, 0x0420)] == [2498, 1000, 1000]
    assert [c.get(address, 1) for address in (0x0004, 0x0005)] == [8, 4]
    assert c.get(0x0008, 2) == 4
    assert SlaveController(has_dc=False).get(0x0008, 2) == 0
    assert c.write(0x0910, bytes(8))
    assert not SlaveController(has_dc=False).write(0x0910, bytes(8))
    assert c.read(0x2FFE, 4) is None


@given(
    start=st.integers(0, 6), length=st.integers(1, 5), start_bit=st.integers(0, 7),
    end_bit=st.integers(0, 7), physical_bit=st.integers(0, 7), offset=st.integers(0, 4),
    octets=st.integers(1, 12), memory=st.binary(min_size=16, max_size=16),
    sent=st.binary(min_size=12, max_size=12),
)  # fmt: skip
@settings(max_examples=examples(300))
def test_bits_of_an_fmmu_against_a_bit_by_bit_model(
    start: int, length: int, start_bit: int, end_bit: int, physical_bit: int, offset: int,
    octets: int, memory: bytes, sent: bytes,
) -> None:  # fmt: skip
    if length == 1 and end_bit < start_bit:
        start_bit, end_bit = end_bit, start_bit
    base, logical = 0x2000, 0x1000
    mapped = range(
        (logical + start) * 8 + start_bit, (logical + start + length - 1) * 8 + end_bit + 1
    )
    place = {bit: (base + offset) * 8 + physical_bit + n for n, bit in enumerate(mapped)}
    window = range(logical * 8, (logical + octets) * 8)

    def bits(data: bytes, at: int) -> dict[int, int]:
        return {at * 8 + n: data[n // 8] >> n % 8 & 1 for n in range(8 * len(data))}

    for kind in (fmmu.READ, fmmu.WRITE):
        c = SlaveController(has_dc=False)
        c.memory[base : base + 16] = memory
        unit = struct.pack(
            "<IHBBHBBBxxx", logical + start, length, start_bit, end_bit, base + offset,
            physical_bit, kind, 1,
        )  # fmt: skip
        assert c.write(0x0600, unit)
        data = bytearray(sent[:octets])
        inside, outside = bits(memory, base), bits(bytes(data), logical)
        pieces = fmmu.pieces(unit, logical, octets)
        for piece in pieces:
            if kind == fmmu.READ:
                assert fmmu.read_piece(c, piece, data)
            else:
                assert fmmu.write_piece(c, piece, data)
        for bit in window:
            if bit in place and kind == fmmu.READ:
                outside[bit] = inside[place[bit]]
            elif bit in place:
                inside[place[bit]] = outside[bit]
        assert bits(bytes(data), logical) == outside
        assert bits(bytes(c.memory[base : base + 16]), base) == inside
        assert bool(pieces) == any(bit in place for bit in window)


@pytest.mark.parametrize(("command", "counter"), [(LRD, 3), (LWR, 2), (LRW, 2 * 2 + 3)])
def test_working_counters_of_logical_commands(command: int, counter: int) -> None:
    master = FrameMaster("coupler", "torque_drive", "digital_in:4", "digital_out:4", "analog_in")
    master.reach_op()
    assert master.cycle(command=command) == counter
    assert master.send(command, LOGICAL + 0x4000, bytes(16))[1] == 0
    master.slaves[1].inject("wkc_short")
    assert master.cycle(command=command) == counter - {LRD: 1, LWR: 1, LRW: 3}[command]
    master.slaves[1].clear("wkc_short")
    master.slaves[1].inject("wkc_short_once", 2)
    short = [master.cycle(command=command) for _ in range(3)]
    assert [counter - each for each in short] == [counter - short[0]] * 2 + [0]
    assert short[0] < counter


def test_two_terminals_share_an_octet() -> None:
    """Outputs in bits 0 to 3 and 4 to 5 of one octet, inputs above them in the next."""
    master = FrameMaster("digital_out:4", "digital_out:2", "digital_in:4", "digital_in:2")
    master.reach_preop()
    for number, (octet, first, last, kind) in enumerate(
        [(0, 0, 3, 2), (0, 4, 5, 2), (1, 2, 5, 1), (1, 6, 7, 1)]
    ):
        control = 0x64 if kind == 2 else 0x20
        master.station(FPWR, number, 0x0800, struct.pack("<HHBBBB", 0x1100, 1, control, 0, 1, 0))
        unit = struct.pack("<IHBBHBBBxxx", LOGICAL + octet, 1, first, last, 0x1100, 0, kind, 1)
        master.station(FPWR, number, 0x0600, unit)
        assert master.request(number, 4) == (4, 0)
    master.send(LRW, LOGICAL, b"\0\0")
    for number in range(4):
        assert master.request(number, 8) == (8, 0)
    data, counter = master.send(LRW, LOGICAL, b"\x2a\x03")
    assert counter == 2 + 2 + 1 + 1
    assert master.line.outputs == {"digital_out": 0xA, "digital_out_2": 0x2}
    for _ in range(2):
        data, _ = master.send(LRW, LOGICAL, b"\x2a\x03")
    assert data == bytes([0x2A, 0x03 | 0xA << 2 | 0x2 << 6])
    assert master.station(FPRD, 0, 0x0110, bytes(2))[1] == 1
