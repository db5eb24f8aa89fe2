"""The safety machine under any sequence of faults, requests and power."""

from __future__ import annotations

import math
from typing import Any

import pytest
from core_checks import ACTION_MODE, EVENTS, MODES, REASONS, REQUESTS, TRANSITIONS, check_safety
from core_kinds import AXIS, DT
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, rule
from random_examples import examples

from controllers.signals import AxisSense, Demand
from rig.kinds import registry
from rig.realtime import axis, safety
from rig.realtime.reasons import Reason, TripReason, reason_table
from rig.realtime.safety import ENABLING, OFF, RUN, STOP_0, STOP_1, STOP_2, TABLE, Mode
from rig.recording.runs.folder import earlier_reasons

PARAMS = safety.Params(enable_ticks=6, stop_ticks=4)

ALL_CATEGORIES = tuple(category for _, category in REASONS.values())


def step(state: safety.State, tick: int, **changes: Any) -> safety.State:
    """Return the state after one step with the given inputs, the others normal."""
    inputs = {
        "trip": 0, "request": 0, "plan_finished": False, "power_required": True, "drive_on": True,
        "category": ALL_CATEGORIES,
        **changes,
    }  # fmt: skip
    return safety.step(PARAMS, state, tick, **inputs)


@pytest.mark.parametrize("mode", TRANSITIONS)
@pytest.mark.parametrize("event", EVENTS)
def test_the_table_follows_iec_60204(mode: str, event: str) -> None:
    action = TRANSITIONS[mode].split()[EVENTS.index(event)]
    assert TABLE[MODES[mode]][EVENTS.index(event)].name == ACTION_MODE.get(action, mode)


def test_every_step_is_as_expected() -> None:
    check_safety(safety)


def test_a_stop_of_category_0_or_1_is_final() -> None:
    reached = {Mode.STOP_1}
    for _ in Mode:
        reached |= {after for mode in reached for after in TABLE[mode]}
    assert reached == {Mode.STOP_1, Mode.STOP_0}
    assert set(TABLE[Mode.STOP_0]) == {Mode.STOP_0}


LAST_EARLIER = 47  # number of a reason in runs that did not record their reasons


def test_every_reason_has_a_category() -> None:
    tables = [
        registry.find(name).room("tick").find_kind("").reason_table
        for name in registry.OWN_PACKAGES
    ]
    for table in tables:
        known = {reason.name: (reason.number, reason.category) for reason in table.reasons}
        assert known.items() <= REASONS.items()
        assert {reason.name for reason in Reason} <= set(known)
        assert all(table.categories[number] == category for number, category in known.values())
    assert {reason.name for table in tables for reason in table.reasons} == set(REASONS)
    # Runs of today record their reasons; the numbers of earlier runs keep their meaning.
    listed = {one._replace(advice="") for table in tables for one in table.reasons}
    assert set(earlier_reasons().reasons) == {one for one in listed if one.number <= LAST_EARLIER}


def test_a_kind_cannot_take_a_number_or_a_name_of_the_core() -> None:
    mine = TripReason(100, "WINCH_LATE", 1, "the winch was late")
    table = reason_table((mine,))
    assert (table.name(100), table.text("WINCH_LATE")) == ("WINCH_LATE", "the winch was late")
    assert (table.categories[100], table.categories[99], table.name(99)) == (1, 0, "reason 99")
    for wrong in (
        mine._replace(number=Reason.POSITION.value),
        mine._replace(name="POSITION"),
        mine._replace(number=300),
        mine._replace(category=2),
    ):
        with pytest.raises(ValueError, match=f"reason {wrong.number} {wrong.name}"):
            reason_table((wrong,))
    with pytest.raises(ValueError, match="taken"):
        reason_table((mine, mine._replace(name="WINCH_LOST")))


@pytest.mark.parametrize("persists", [name for name, (_, c) in REASONS.items() if c == 1])
@pytest.mark.parametrize("request_name", ["NONE", "STOP", "HOLD", "RESUME", "LOGGER_LOST"])
def test_a_controlled_stop_ends_in_time_whatever_persists(persists: str, request_name: str) -> None:
    state = step(safety.State(RUN, 0, 0), 10, trip=REASONS["POSITION"][0])
    assert state == (STOP_1, 10, Reason.POSITION)
    for tick in range(11, 20):
        request = REQUESTS[request_name][0]
        state = step(state, tick, trip=REASONS[persists][0], request=request, plan_finished=True)
        assert state.mode == (STOP_1 if tick < 10 + PARAMS.stop_ticks else STOP_0)
        assert state.reason == Reason.POSITION


@pytest.mark.parametrize("mode", [OFF, ENABLING, RUN, STOP_2, STOP_1])
@pytest.mark.parametrize("trip", [name for name, (_, c) in REASONS.items() if c == 1])
def test_an_abort_cuts_power_even_while_a_lesser_trip_persists(mode: int, trip: str) -> None:
    number = REASONS[trip][0]
    expected_reason = number if mode == STOP_1 else 0
    state = step(
        safety.State(mode, 0, expected_reason), 1, trip=number, request=safety.REQUEST_ABORT
    )
    assert state.mode == STOP_0
    assert state.reason == (expected_reason or Reason.OPERATOR_ABORT)


def test_a_worse_fault_in_a_controlled_stop_cuts_power_and_keeps_the_first_cause() -> None:
    state = step(safety.State(RUN, 0, 0), 1, trip=Reason.VELOCITY.value)
    state = step(state, 2, trip=Reason.STALE_ENCODER.value)
    assert state == (STOP_0, 2, Reason.VELOCITY)


def test_hold_and_resume() -> None:
    state = step(safety.State(RUN, 0, 0), 1, request=safety.REQUEST_HOLD)
    assert state == (STOP_2, 1, 0)
    state = step(state, 2, request=safety.REQUEST_HOLD)  # a level: it persists until the next
    assert state == (STOP_2, 1, 0)
    state = step(state, 50, request=safety.REQUEST_RESUME)
    assert state == (RUN, 50, 0)
    assert step(state, 51, request=safety.REQUEST_RESUME) is state


def test_an_early_hold_takes_effect_in_run() -> None:
    state, modes = safety.start(0), []
    for tick in range(6):
        state = step(state, tick, request=safety.REQUEST_HOLD, drive_on=tick > 2)
        modes.append(state.mode)
    assert modes == [ENABLING, ENABLING, ENABLING, RUN, STOP_2, STOP_2]


def test_a_drive_that_enables_in_the_last_tick_is_in_time() -> None:
    for late in (0, 1):
        state = safety.State(ENABLING, 0, 0)
        for tick in range(1, PARAMS.enable_ticks + 1 + late):
            state = step(state, tick, drive_on=tick == PARAMS.enable_ticks + late)
        if late:
            assert state == (STOP_0, PARAMS.enable_ticks, Reason.DRIVE_NOT_ON)
        else:
            assert state == (RUN, PARAMS.enable_ticks, 0)


DEMAND = Demand(-500.0, 900.0, 0.0, 321.0)


class Interleavings(RuleBasedStateMachine):
    """The machine and the limiter of one axis with any inputs in any order."""

    def __init__(self) -> None:
        super().__init__()
        self.tick = 0
        self.safety_state = safety.start(0)
        self.axis = axis.start()
        self.counts = 0
        self.before = self.safety_state
        self.force = 0.0
        self.enable = 0
        self.trip = self.request = 0
        self.stopped_at: int | None = None
        self.first: int = 0

    def _tick(
        self, trip: int, request: int, plan_finished: bool, power_required: bool, drive_on: bool
    ) -> None:
        self.tick += 1
        self.before, self.trip, self.request = self.safety_state, trip, request
        self.safety_state = safety.step(
            PARAMS,
            self.safety_state,
            self.tick,
            trip,
            request,
            plan_finished,
            power_required,
            drive_on,
        )
        self.counts += 40
        sense = AxisSense(self.counts, 0.0, 0.0, int(drive_on), 0, 0.0)
        motion = axis.observe(AXIS, self.axis, sense, 0.0, 1, DT)
        self.axis, record = axis.control(
            AXIS, self.axis, sense, motion, DEMAND, 1, 0, self.safety_state.mode, DT
        )
        self.force, self.enable = record.command.force, record.command.enable
        if self.safety_state.mode >= STOP_1 and self.stopped_at is None:
            self.stopped_at, self.first = self.tick, self.safety_state.reason

    @rule(power_required=st.booleans(), drive_on=st.booleans(), n=st.integers(1, 4))
    def quiet(self, power_required: bool, drive_on: bool, n: int) -> None:
        for _ in range(n):
            self._tick(0, 0, False, power_required, drive_on)
            self.holds()

    @rule(n=st.integers(1, 8))
    def normal(self, n: int) -> None:
        for _ in range(n):
            self._tick(0, 0, False, True, True)
            self.holds()

    @rule(
        trip=st.sampled_from([0, 0, 0, *(r.value for r in Reason)]),
        request=st.integers(0, 8),
        plan_finished=st.booleans(),
        drive_on=st.booleans(),
        n=st.integers(1, 3),
    )
    def anything(
        self, trip: int, request: int, plan_finished: bool, drive_on: bool, n: int
    ) -> None:
        for _ in range(n):
            self._tick(trip, request, plan_finished, True, drive_on)
            self.holds()

    @rule(request=st.sampled_from([safety.REQUEST_HOLD, safety.REQUEST_RESUME]))
    def hold_or_resume(self, request: int) -> None:
        self._tick(0, request, False, True, True)

    @invariant()
    def holds(self) -> None:
        mode, last = self.safety_state.mode, self.before.mode
        assert math.isfinite(self.force)
        if self.force != 0.0:
            assert mode in (RUN, STOP_1, STOP_2)
        assert self.enable == int(ENABLING <= mode <= STOP_1)
        if self.stopped_at is not None:
            assert mode in (STOP_1, STOP_0)
            assert mode >= last or last < STOP_1
            assert self.safety_state.reason == self.first != 0
            if self.tick >= self.stopped_at + PARAMS.stop_ticks:
                assert mode == STOP_0
        if mode == STOP_2 != last:
            assert (last, self.request) == (RUN, safety.REQUEST_HOLD)
        if mode == RUN != last:
            if last == STOP_2:
                assert self.request == safety.REQUEST_RESUME
            else:
                assert last == ENABLING
        if mode < STOP_1:
            assert self.trip == 0
            assert self.safety_state.reason == 0
        aborted = self.request == safety.REQUEST_ABORT
        if aborted or (self.trip and ALL_CATEGORIES[self.trip] == 0):
            assert mode == STOP_0
            assert (self.force, self.enable) == (0.0, 0)
        elif self.trip:
            assert mode in (STOP_1, STOP_0)


Interleavings.TestCase.settings = settings(max_examples=examples(150), stateful_step_count=25)
TestInterleavings = Interleavings.TestCase
