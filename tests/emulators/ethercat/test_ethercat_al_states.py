"""AL states: steps and their codes, process data by state, the watchdog; any order of requests."""

from __future__ import annotations

import struct

import pytest
from frame_master import FPWR, INIT, LRW, OP, PREOP, SAFEOP, FrameMaster
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule
from random_examples import examples

ERROR = ACKNOWLEDGE = 0x10
NEXT = {INIT: PREOP, PREOP: SAFEOP, SAFEOP: OP}


def one(name: str = "torque_drive") -> FrameMaster:
    return FrameMaster(name)


def test_steps_may_not_be_skipped_and_errors_are_acknowledged() -> None:
    master = one()
    master.reach_preop()
    assert master.request(0, OP) == (PREOP | ERROR, 0x11)
    assert master.request(0, SAFEOP) == (PREOP | ERROR, 0x11)  # deaf until it is acknowledged
    assert master.request(0, PREOP | ACKNOWLEDGE) == (PREOP, 0)
    assert master.request(0, 0x05) == (PREOP | ERROR, 0x12)
    assert master.request(0, INIT | ACKNOWLEDGE) == (INIT, 0)
    assert master.request(0, 3) == (INIT | ERROR, 0x13)


def test_preop_needs_the_mailbox_of_the_sii() -> None:
    master = one()
    assert master.send(FPWR + 0, 0, b"")[1] == 0
    master.station(FPWR, -0x1001, 0x0010, b"\x01\x10")  # station address 0 becomes 0x1001
    assert master.request(0, PREOP) == (INIT | ERROR, 0x16)
    master.station(FPWR, 0, 0x0800, bytes.fromhex("0010800026000100"))
    master.station(FPWR, 0, 0x0808, bytes.fromhex("8010400022000100"))
    assert master.request(0, PREOP | ACKNOWLEDGE) == (INIT | ERROR, 0x16)
    master.station(FPWR, 0, 0x0808, bytes.fromhex("8010800022000100"))
    assert master.request(0, PREOP | ACKNOWLEDGE) == (PREOP, 0)


@pytest.mark.parametrize(
    ("outputs", "inputs", "code"),
    [(6, 10, 0), (5, 10, 0x1D), (7, 10, 0x1D), (0, 10, 0x1D), (6, 11, 0x1E), (6, 0, 0x1E)],
)
def test_safeop_needs_the_mapped_lengths(outputs: int, inputs: int, code: int) -> None:
    master = one()
    master.reach_preop()
    for at, start, octets, control in (
        (0x0810, 0x1100, outputs, 0x64),
        (0x0818, 0x1800, inputs, 0x20),
    ):
        registers = struct.pack("<HHBBBB", start, octets, control, 0, bool(octets), 0)
        master.station(FPWR, 0, at, registers)
    expected = (PREOP | ERROR, code) if code else (SAFEOP, 0)
    assert master.request(0, SAFEOP) == expected


def test_process_data_by_state() -> None:
    """Below SAFEOP nothing; in SAFEOP outputs count and do nothing; in OP they act."""
    master = FrameMaster("digital_out:4")
    master.reach_preop()
    assert master.station(FPWR, 0, 0x1100, b"\x0f")[1] == 1  # memory without a sync manager
    master.reach_safeop()
    assert master.cycle({0: b"\x05"}) == 2
    assert master.line.outputs["digital_out"] == 0
    assert master.request(0, OP) == (OP, 0)
    assert master.cycle({0: b"\x05"}) == 2
    assert master.line.outputs["digital_out"] == 5
    assert master.request(0, SAFEOP) == (SAFEOP, 0)
    assert master.line.outputs["digital_out"] == 0
    assert master.request(0, PREOP) == (PREOP, 0)
    assert master.cycle({0: b"\x05"}) == 0


def test_op_waits_for_outputs() -> None:
    master = one()
    master.reach_preop()
    master.reach_safeop()
    assert master.request(0, OP) == (SAFEOP, 0)
    master.pass_time(500)
    assert master.status(0) == (SAFEOP, 0)
    master.cycle()
    assert master.status(0) == (OP, 0)
    assert master.request(0, SAFEOP) == (SAFEOP, 0)
    master.pass_time(200)  # the last outputs are too old
    assert master.request(0, OP) == (SAFEOP, 0)
    master.pass_time(1100)
    assert master.status(0) == (SAFEOP | ERROR, 0x1B)


def test_the_watchdog_time_is_that_of_the_registers() -> None:
    master = one()
    master.reach_op()
    master.write(0, 0x0420, 200, 2)  # 20 ms
    for _ in range(100):
        master.cycle()
    master.pass_time(18)
    assert master.status(0) == (OP, 0)
    master.pass_time(3)
    assert master.status(0) == (SAFEOP | ERROR, 0x1B)
    assert master.read(0, 0x0442, 1) == 1
    assert master.cycle() == 3
    assert master.request(0, OP) == (SAFEOP | ERROR, 0x1B)
    assert master.request(0, SAFEOP | ACKNOWLEDGE) == (SAFEOP, 0)
    master.cycle()
    assert master.request(0, OP) == (OP, 0)


def test_a_watchdog_of_0_is_off() -> None:
    master = one()
    master.reach_op()
    master.write(0, 0x0420, 0, 2)
    master.pass_time(5000)
    assert master.status(0) == (OP, 0)


def test_inputs_alone_have_no_watchdog() -> None:
    master = FrameMaster("digital_in:4")
    master.reach_op()
    master.pass_time(5000)
    assert master.status(0) == (OP, 0)


def test_sync0_needs_its_unit() -> None:
    master = one()
    master.reach_preop()
    assert master.download(0, 0x1C32, 1, b"\x02\0") == 0
    master.reach_safeop()
    master.cycle()
    assert master.request(0, OP) == (SAFEOP | ERROR, 0x30)
    master.write(0, 0x09A0, 1_000_000, 4)
    assert master.write(0, 0x0981, 3, 1) == 1
    assert master.request(0, SAFEOP | ACKNOWLEDGE) == (SAFEOP, 0)
    master.cycle()
    assert master.request(0, OP) == (OP, 0)


class AnyRequests(RuleBasedStateMachine):
    """Requests of any kind in any order, frames and silence between them."""

    @initialize()
    def begin(self) -> None:
        self.master = FrameMaster("torque_drive")
        self.master.reach_preop()
        self.master.reach_safeop()
        self.state, self.error = SAFEOP, False

    @rule(state=st.sampled_from([INIT, PREOP, SAFEOP, OP, 3, 7]), acknowledge=st.booleans())
    def request(self, state: int, acknowledge: bool) -> None:
        value = state | (ACKNOWLEDGE if acknowledge else 0)
        status, code = self.master.request(0, value)
        after, failed = status & 0x0F, bool(status & ERROR)
        assert failed == (code != 0)
        if self.error and not acknowledge:
            assert (after, failed) == (self.state, True)
        else:
            assert after in (self.state, state)
            assert after <= self.state or after == NEXT.get(self.state)
            if state in (3, 7) or (state > self.state and NEXT.get(self.state) != state):
                assert failed
                assert after == self.state
            elif state <= self.state:
                assert (after, failed) == (state, False)
        self.state, self.error = after, failed

    @rule(frames=st.integers(1, 5))
    def exchange(self, frames: int) -> None:
        for _ in range(frames):
            counter = self.master.cycle()
            assert counter == (3 if self.state >= SAFEOP else 0)
        status, _ = self.master.status(0)
        assert status & 0x0F in (self.state, OP if self.state == SAFEOP else self.state)
        self.state = status & 0x0F

    @rule(ms=st.sampled_from([20, 99, 150, 1500]))
    def be_silent(self, ms: int) -> None:
        was_op = self.state == OP
        self.master.pass_time(ms)
        status, code = self.master.status(0)
        if was_op and ms > 100:
            assert (status, code) == (SAFEOP | ERROR, 0x1B)
        self.state, self.error = status & 0x0F, bool(status & ERROR)

    @invariant()
    def the_drive_has_power_in_op_only(self) -> None:
        if hasattr(self, "master") and self.state != OP:
            device = self.master.slaves[0].device
            assert not getattr(device, "powered", False)


AnyRequests.TestCase.settings = settings(max_examples=examples(40), stateful_step_count=30)
TestAnyRequests = AnyRequests.TestCase


def test_no_logical_data_without_units() -> None:
    master = one()
    master.reach_preop()
    assert master.send(LRW, 0x10000, bytes(16)) == (bytes(16), 0)
