"""The power machine and a drive under any interleaving of goals, requests, faults and silence."""

from __future__ import annotations

from typing import Any

from drive_402 import PARAMS, STATUSWORD, Drive, DriveLoop
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule
from random_examples import examples

from drivers.cia402.state_machine import DisarmReason
from drivers.cia402.state_table import Goal
from drivers.cia402.statusword import DriveState

UP = {0x06, 0x07, 0x0F}  # controlwords that raise the level from some state


class Interleavings(RuleBasedStateMachine):
    """Machine and drive under events in any order."""

    def __init__(self) -> None:
        super().__init__()
        self.rig = DriveLoop(Drive())
        self.before = self.rig.state
        self.arm_requested = False

    def _tick(self, n: int = 1, **changes: Any) -> None:
        for _ in range(n):
            self.before = self.rig.state
            self.arm_requested = changes.get("arm", self.rig.inputs.arm) != self.before.arm
            self.rig.run(1, **changes)
            self.assert_safe()

    @rule(n=st.integers(1, 6), goal=st.sampled_from(Goal))
    def change_goal(self, n: int, goal: Goal) -> None:
        self._tick(n, goal=goal)

    @rule(arm=st.booleans(), reset=st.booleans())
    def send_requests(self, arm: bool, reset: bool) -> None:
        inputs = self.rig.inputs
        self._tick(arm=inputs.arm + arm, reset=inputs.reset + reset)

    @rule(state=st.sampled_from(sorted(STATUSWORD)), n=st.integers(1, 3))
    def force_state(self, state: str, n: int) -> None:
        self.rig.drive.state = state
        self._tick(n)

    @rule(age=st.floats(), n=st.integers(1, 3))
    def age_statusword(self, age: float, n: int) -> None:
        self._tick(n, age=age)
        self.rig.inputs = self.rig.inputs._replace(age=0.001)

    @rule(stuck=st.booleans(), mode_display=st.sampled_from([0, 6, 10]))
    def break_drive(self, stuck: bool, mode_display: int) -> None:
        self.rig.drive.stuck, self.rig.drive.mode_display = stuck, mode_display
        self._tick()

    @rule()
    def enable(self) -> None:
        self.rig.drive.stuck, self.rig.drive.mode_display = False, 10
        self._tick(arm=self.rig.inputs.arm + 1, goal=Goal.ENABLED)
        self._tick(9)

    @invariant()
    def assert_safe(self) -> None:
        state, out, inputs = self.rig.state, self.rig.output, self.rig.inputs
        if state.armed > self.before.armed:
            assert self.arm_requested
            assert out.drive == DriveState.SWITCH_ON_DISABLED
        if out.controlword & 0x8F in UP:
            assert state.armed == 1
            assert state.reason == DisarmReason.NONE
        if state.armed == 0:
            assert out.controlword in (0x00, 0x02, 0x80)
            assert state.reason != DisarmReason.NONE
        if out.controlword == 0x80:
            assert state.resetting == 1
            assert out.drive == DriveState.FAULT
        if out.setpoint:
            assert (out.drive, inputs.goal) == (DriveState.OPERATION_ENABLED, Goal.ENABLED)
            assert self.rig.drive.mode_display == 10
        if not (0.0 <= inputs.age <= PARAMS.max_status_age):
            assert out == (0x02 if inputs.goal == Goal.QUICK_STOP else 0x00, 0, 0, 0)


Interleavings.TestCase.settings = settings(max_examples=examples(100), stateful_step_count=30)
TestInterleavings = Interleavings.TestCase
