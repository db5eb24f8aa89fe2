"""The power machine and a drive under any interleaving of goals, requests, faults and silence."""

from __future__ import annotations

from typing import Any

from drive_402 import PARAMS, WORD, Drive, Rig
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule

from drivers.canopen.cia402 import Why
from drivers.canopen.cia402_table import Goal
from drivers.canopen.statusword import DriveState

UP = {0x06, 0x07, 0x0F}  # words that lead up from somewhere


class Interleavings(RuleBasedStateMachine):
    """Machine and drive, with anything happening in any order."""

    def __init__(self) -> None:
        super().__init__()
        self.rig = Rig(Drive())
        self.before = self.rig.state
        self.asked = False

    def _tick(self, n: int = 1, **what: Any) -> None:
        for _ in range(n):
            self.before = self.rig.state
            self.asked = what.get("arm", self.rig.told.arm) != self.before.arm
            self.rig.run(1, **what)
            self.holds()

    @rule(n=st.integers(1, 6), goal=st.sampled_from(Goal))
    def wants(self, n: int, goal: Goal) -> None:
        self._tick(n, goal=goal)

    @rule(arm=st.booleans(), reset=st.booleans())
    def asks(self, arm: bool, reset: bool) -> None:
        told = self.rig.told
        self._tick(arm=told.arm + arm, reset=told.reset + reset)

    @rule(state=st.sampled_from(sorted(WORD)), n=st.integers(1, 3))
    def jumps(self, state: str, n: int) -> None:
        self.rig.drive.state = state
        self._tick(n)

    @rule(age=st.floats(), n=st.integers(1, 3))
    def ages(self, age: float, n: int) -> None:
        self._tick(n, age=age)
        self.rig.told = self.rig.told._replace(age=0.001)

    @rule(stuck=st.booleans(), shown=st.sampled_from([0, 6, 10]))
    def breaks(self, stuck: bool, shown: int) -> None:
        self.rig.drive.stuck, self.rig.drive.shown = stuck, shown
        self._tick()

    @rule()
    def goes_up(self) -> None:
        self.rig.drive.stuck, self.rig.drive.shown = False, 10
        self._tick(arm=self.rig.told.arm + 1, goal=Goal.ENABLED)
        self._tick(9)

    @invariant()
    def holds(self) -> None:
        state, out, told = self.rig.state, self.rig.out, self.rig.told
        if state.armed > self.before.armed:
            assert self.asked
            assert out.drive == DriveState.SWITCH_ON_DISABLED
        if out.controlword & 0x8F in UP:
            assert state.armed == 1
            assert state.why == Why.NONE
        if state.armed == 0:
            assert out.controlword in (0x00, 0x02, 0x80)
            assert state.why != Why.NONE
        if out.controlword == 0x80:
            assert state.resetting == 1
            assert out.drive == DriveState.FAULT
        if out.setpoint:
            assert (out.drive, told.goal) == (DriveState.OPERATION_ENABLED, Goal.ENABLED)
            assert self.rig.drive.shown == 10
        if not (0.0 <= told.age <= PARAMS.stale):
            assert out == (0x02 if told.goal == Goal.QUICK_STOP else 0x00, 0, 0, 0)


Interleavings.TestCase.settings = settings(max_examples=100, stateful_step_count=30, deadline=None)
TestInterleavings = Interleavings.TestCase
