"""The CiA 402 machine: table, permission, fault reset, deadlines and set-point."""

from __future__ import annotations

import itertools
import math
from typing import Any

import pytest
from canopen.profiles import p402
from drive_402 import DEADLINES, PARAMS, QUIET, STATUSWORD, Drive, DriveLoop

from drivers.cia402 import state_machine
from drivers.cia402.state_machine import Deadlines, DisarmReason, Params, State, explain
from drivers.cia402.state_table import AWAITED, CONTROLWORDS, LEVEL, Awaited, Goal
from drivers.cia402.statusword import DriveState, decode

UP = {0x06, 0x07, 0x0F}  # words that lead up from somewhere


def one(state: State, params: Params = PARAMS, **inputs: Any) -> tuple[State, state_machine.Output]:
    return state_machine.step(params, state, QUIET._replace(**inputs))


# The meaning of every cell of the tables, in another form.
PATHS = {
    "UNKNOWN": "0 0 0 2", "NOT_READY_TO_SWITCH_ON": "0 0 0 0", "SWITCH_ON_DISABLED": "0 6 6 0",
    "READY_TO_SWITCH_ON": "0 6 7 2", "SWITCHED_ON": "0 6 F 2", "OPERATION_ENABLED": "0 6 F 2",
    "QUICK_STOP_ACTIVE": "0 0 0 2", "FAULT_REACTION_ACTIVE": "0 0 0 0", "FAULT": "0 0 0 0",
}  # fmt: skip


def test_the_table_reaches_its_goals() -> None:
    assert len(CONTROLWORDS) == len(AWAITED) == len(LEVEL) == len(DriveState)
    for state in DriveState:
        assert list(CONTROLWORDS[state]) == [int(word, 16) for word in PATHS[state.name].split()]


def test_every_awaited_transition_matches_its_controlword() -> None:
    """A drive that obeys the table's controlwords ends in the goal state."""
    ends = {Goal.SAFE: "SOD", Goal.READY: "RTSO", Goal.ENABLED: "OE", Goal.QUICK_STOP: "SOD"}
    for begin, goal in itertools.product(("NR", "SOD", "RTSO", "SO", "OE", "QSA"), Goal):
        drive = Drive(begin)
        drive.left = 3
        for _ in range(9):
            state = decode(drive.statusword)
            if AWAITED[state][goal] == Awaited.NOTHING:
                break
            drive.tick(CONTROLWORDS[state][goal])
        assert drive.state == ends[goal]


def test_an_independent_table_knows_every_step_of_every_way() -> None:
    """Step by step from each state to each goal, with the words of the peer's transitions."""
    peer = {
        tuple(name.replace(" ", "_") for name in pair): word
        for pair, word in p402.State402.TRANSITIONTABLE.items()
    }
    ways = {
        Goal.SAFE: {}, Goal.QUICK_STOP: {"OPERATION_ENABLED": "QUICK_STOP_ACTIVE"},
        Goal.READY: {
            "SWITCH_ON_DISABLED": "READY_TO_SWITCH_ON", "SWITCHED_ON": "READY_TO_SWITCH_ON",
            "OPERATION_ENABLED": "READY_TO_SWITCH_ON",
        },
        Goal.ENABLED: {
            "SWITCH_ON_DISABLED": "READY_TO_SWITCH_ON", "READY_TO_SWITCH_ON": "SWITCHED_ON",
            "SWITCHED_ON": "OPERATION_ENABLED",
        },
    }  # fmt: skip
    for goal, way in ways.items():
        for state in DriveState:
            down = (state.name, "SWITCH_ON_DISABLED")
            after = way.get(state.name, "SWITCH_ON_DISABLED" if goal == Goal.SAFE else "")
            if after and (state.name, after) in peer and state != DriveState.FAULT:
                assert peer[state.name, after] == CONTROLWORDS[state][goal], (state, goal)
            if AWAITED[state][goal] == Awaited.DISABLE_VOLTAGE:
                assert peer[down] == CONTROLWORDS[state][goal] == 0x00


def contexts() -> list[tuple[str, State, Params]]:
    armed = State(1, 0, 0, 0, 0, 0, -1, 0, 0)
    late = armed._replace(awaited=int(Awaited.MODE), ticks=99)
    return [
        ("not requested", state_machine.start(0, 0), PARAMS),
        ("armed", armed, PARAMS),
        ("armed, all options", late, PARAMS._replace(resume=1, follows=1, mode_first=0)),
        ("requested now", state_machine.start(-1, -1), PARAMS),
    ]


@pytest.mark.parametrize(("name", "state", "params"), contexts(), ids=lambda v: str(v)[:20])
def test_no_statusword_enables_without_request(name: str, state: State, params: Params) -> None:
    for goal in Goal:
        inputs = QUIET._replace(goal=int(goal), mode_bits=0xFFFF)
        for statusword in range(0x10000):
            after, out = state_machine.step(params, state, inputs._replace(statusword=statusword))
            word, setpoint, drive, acting = out
            core = word & 0x8F
            assert word & ~0x17F == 0
            assert word in (0x00, 0x02) or core in UP
            if core in UP:
                assert after.armed == 1
                assert goal in (Goal.READY, Goal.ENABLED)
                assert drive not in (DriveState.FAULT, DriveState.UNKNOWN)
            if core == 0x0F:
                assert goal == Goal.ENABLED
                assert drive in (
                    DriveState.SWITCHED_ON,
                    DriveState.OPERATION_ENABLED,
                    DriveState.QUICK_STOP_ACTIVE if params.resume else DriveState.SWITCHED_ON,
                )
            if word & 0x170:
                assert (core, drive) == (0x0F, DriveState.OPERATION_ENABLED)
            if setpoint or acting:
                assert acting == after.armed == 1
                assert (goal, drive) == (Goal.ENABLED, DriveState.OPERATION_ENABLED)
                assert core == 0x0F
            if goal == Goal.QUICK_STOP:
                assert after.armed == 0


def test_without_a_request_no_goal_enables() -> None:
    for begin in ("SOD", "RTSO", "SO", "OE"):
        rig = DriveLoop(Drive(begin)).run(20, goal=Goal.ENABLED)
        assert set(rig.controlwords) == {0}
        assert rig.drive.state == "SOD"
        assert explain(rig.state) == "NOT_REQUESTED"


def test_enable_and_disable_sequence() -> None:
    rig = DriveLoop(Drive("NR")).run(3, goal=Goal.SAFE).run(1, arm=1).run(2)
    assert set(rig.controlwords) == {0}
    rig.controlwords.clear()
    rig.run(12, goal=Goal.ENABLED)
    assert [word for word, _ in itertools.groupby(rig.controlwords)] == [0x06, 0x07, 0x0F]
    assert rig.output.acting == 1
    assert explain(rig.state) == ""
    rig.controlwords.clear()
    assert rig.run(4, goal=Goal.READY).drive.state == "RTSO"
    assert rig.run(6, goal=Goal.ENABLED).drive.state == "OE"
    assert rig.run(4, goal=Goal.SAFE).drive.state == "SOD"
    assert rig.state.armed == 1  # going down on purpose costs nothing
    assert rig.run(9, goal=Goal.ENABLED).drive.state == "OE"


def test_a_request_that_cannot_be_granted_is_discarded() -> None:
    """Neither a stale word, a fault, a quick stop nor a drive with power on lets it through."""
    start = state_machine.start(0, 0)
    for inputs in (
        {"age": 0.0051}, {"age": -1e-9}, {"age": math.nan}, {"age": math.inf},
        {"statusword": STATUSWORD["F"]}, {"statusword": STATUSWORD["FR"]},
        {"statusword": STATUSWORD["NR"]}, {"statusword": STATUSWORD["OE"]},
        {"statusword": STATUSWORD["SO"]}, {"statusword": STATUSWORD["RTSO"]},
        {"statusword": STATUSWORD["QSA"]}, {"statusword": 0xFFFF}, {"goal": Goal.QUICK_STOP},
    ):  # fmt: skip
        state, out = one(start, arm=1, **inputs)
        assert (state.armed, out.controlword in (0, 2)) == (0, True)
        state, out = one(state, arm=1)
        assert (state.armed, out.controlword) == (0, 0)
        state, out = one(state, arm=2)
        assert (state.armed, out.controlword) == (1, 0x06)


@pytest.mark.parametrize(
    ("inputs", "reason"),
    [
        ({"age": 0.0051}, DisarmReason.STALE),
        ({"age": -0.001}, DisarmReason.STALE),
        ({"age": math.nan}, DisarmReason.STALE),
        ({"goal": Goal.QUICK_STOP}, DisarmReason.QUICK_STOP),
    ],
)
def test_a_lost_permission_does_not_return(inputs: dict[str, Any], reason: DisarmReason) -> None:
    rig = DriveLoop(Drive()).up().run(1, **inputs)
    assert (rig.output.setpoint, rig.output.acting, rig.state.reason) == (0, 0, reason)
    rig.controlwords.clear()
    rig.run(50, age=0.001, goal=Goal.ENABLED)
    assert set(rig.controlwords) == {0}
    assert rig.drive.state == "SOD"
    rig.up()


@pytest.mark.parametrize(
    ("state", "reason"),
    [
        ("F", DisarmReason.FAULT), ("FR", DisarmReason.FAULT),
        ("QSA", DisarmReason.DROPPED), ("SOD", DisarmReason.DROPPED),
        ("RTSO", DisarmReason.DROPPED), ("SO", DisarmReason.DROPPED), ("NR", DisarmReason.DROPPED),
    ],
)  # fmt: skip
def test_a_drive_that_leaves_by_itself_stays_down(state: str, reason: DisarmReason) -> None:
    rig = DriveLoop(Drive()).up()
    rig.drive.state = state
    rig.run(1)
    assert (rig.state.reason, rig.output.controlword, rig.output.setpoint) == (reason, 0, 0)
    rig.controlwords.clear()
    rig.run(40)
    assert set(rig.controlwords) == {0}
    assert rig.drive.state == ("F" if reason == DisarmReason.FAULT else "SOD")


def test_an_unknown_statusword_ends_the_permission() -> None:
    rig = DriveLoop(Drive()).up()
    rig.drive.bits = 0x0048
    rig.run(1)
    assert (rig.state.reason, rig.output) == (
        DisarmReason.UNKNOWN_STATE,
        (0, 0, DriveState.UNKNOWN, 0),
    )


def test_a_fault_is_reset_by_one_edge_on_request_only() -> None:
    rig = DriveLoop(Drive()).up()
    rig.drive.fault()
    rig.run(30)
    assert rig.drive.state == "F"
    rig.controlwords.clear()
    rig.run(10, reset=1)
    assert rig.controlwords[:4] == [0x00, 0x00, 0x80, 0x80]
    assert set(rig.controlwords[4:]) == {0x00}
    assert (rig.drive.state, rig.state.armed, rig.state.reason) == ("SOD", 0, DisarmReason.FAULT)
    rig.up()


def test_a_reset_without_a_fault_is_discarded() -> None:
    rig = DriveLoop(Drive()).up().run(3, reset=1)
    assert rig.output.acting == 1
    rig.drive.fault()
    rig.controlwords.clear()
    rig.run(20)
    assert 0x80 not in rig.controlwords


def test_a_reset_that_a_drive_ignores_is_named_and_may_be_repeated() -> None:
    rig = DriveLoop(Drive("F"))
    rig.drive.stuck = True
    rig.run(2).controlwords.clear()
    rig.run(20, reset=1)
    assert rig.controlwords.count(0x80) == PARAMS.reset_ticks
    assert explain(rig.state) == "NOT_REQUESTED; FAULT_RESET took too long"
    rig.run(6, reset=2)
    assert rig.controlwords.count(0x80) == 2 * PARAMS.reset_ticks
    rig.run(6, age=1.0).controlwords.clear()  # never into the blue
    rig.run(6, reset=3)
    assert set(rig.controlwords) == {0}


@pytest.mark.parametrize(
    ("at", "goal", "awaited"),
    [
        ("SOD", Goal.READY, Awaited.SHUTDOWN),
        ("SOD", Goal.ENABLED, Awaited.SHUTDOWN),
        ("RTSO", Goal.ENABLED, Awaited.SWITCH_ON),
        ("SO", Goal.ENABLED, Awaited.ENABLE),
        ("OE", Goal.READY, Awaited.SHUTDOWN),
        ("OE", Goal.SAFE, Awaited.DISABLE_VOLTAGE),
        ("OE", Goal.QUICK_STOP, Awaited.QUICK_STOP),
        ("QSA", Goal.QUICK_STOP, Awaited.RAMP_END),
        ("NR", Goal.SAFE, Awaited.BOOT),
        ("FR", Goal.SAFE, Awaited.FAULT_REACTION),
    ],
)
def test_every_transition_has_a_deadline_with_a_name(at: str, goal: Goal, awaited: Awaited) -> None:
    state = State(1, 0, 0, 0, 0, 0, -1, 0, 0)
    limit = DEADLINES[awaited]
    for tick in range(1, limit + 2):
        state, out = one(state, statusword=STATUSWORD[at], goal=goal)
        assert state.missed_transition == (awaited if tick > limit else 0)
        if tick <= limit and at not in ("NR", "FR"):
            assert out.controlword == CONTROLWORDS[decode(STATUSWORD[at])][goal]
    assert (state.armed, out.controlword) == (0, 0)
    assert awaited.name in explain(state)
    if at in ("SOD", "RTSO", "SO"):
        assert state.reason == DisarmReason.LATE


def test_a_quick_stop_that_the_drive_ignores_ends_without_voltage() -> None:
    rig = DriveLoop(Drive()).up()
    rig.drive.stuck = True
    rig.controlwords.clear()
    rig.run(20, goal=Goal.QUICK_STOP)
    n = DEADLINES.quick_stop
    assert rig.controlwords == [0x02] * n + [0x00] * (20 - n)
    assert rig.state.missed_transition == Awaited.QUICK_STOP


def test_a_quick_stop_keeps_its_ramp() -> None:
    rig = DriveLoop(Drive(ramp=5)).up()
    rig.controlwords.clear()
    rig.run(12, goal=Goal.QUICK_STOP)
    assert rig.controlwords[:6] == [0x02] * 6
    assert (rig.drive.state, rig.state.missed_transition) == ("SOD", 0)


def test_a_drive_that_stays_in_quick_stop_resumes_only_on_request() -> None:
    rig = DriveLoop(Drive(holds=True), PARAMS._replace(resume=1)).up().run(40, goal=Goal.QUICK_STOP)
    assert (rig.drive.state, rig.state.missed_transition) == ("QSA", 0)
    rig.run(6, goal=Goal.QUICK_STOP, arm=9)
    assert rig.output.controlword == 0x02
    rig.controlwords.clear()
    rig.up()
    assert set(rig.controlwords) == {0x0F}  # transition 16, not by way of no power
    rig.run(9, goal=Goal.QUICK_STOP).run(3, goal=Goal.ENABLED)
    assert rig.drive.state == "SOD"


def test_the_set_point_waits_for_the_mode() -> None:
    params = PARAMS._replace(mode_first=0)
    rig = DriveLoop(Drive(), params)
    rig.drive.mode_display = 1
    rig.run(7, arm=1, mode_bits=0x170)
    assert (rig.output, rig.drive.state) == ((0x10F, 0, DriveState.OPERATION_ENABLED, 0), "OE")
    rig.drive.mode_display = 10
    assert rig.run(1).output == (0x17F, 123, DriveState.OPERATION_ENABLED, 1)
    rig.drive.mode_display = 6
    assert rig.run(1).output == (0x10F, 0, DriveState.OPERATION_ENABLED, 0)
    rig.run(DEADLINES.mode)
    assert (rig.state.reason, rig.output.controlword) == (DisarmReason.LATE, 0)
    assert explain(rig.state) == "MODE took too long"


def test_the_power_stage_waits_for_the_mode() -> None:
    rig = DriveLoop(Drive())
    rig.drive.mode_display = 0
    rig.run(8, arm=1)
    assert (rig.drive.state, rig.state.armed) == ("SO", 1)
    rig.run(8)
    assert (rig.drive.state, explain(rig.state)) == ("SOD", "MODE took too long")
    rig = DriveLoop(Drive())
    rig.drive.mode_display = 0
    rig.run(20, arm=1, mode=0)  # no mode is no mode
    assert explain(rig.state) == "MODE took too long"


def test_the_set_point_waits_for_bit_12_in_cyclic_modes() -> None:
    params = PARAMS._replace(follows=1)
    rig = DriveLoop(Drive(), params).run(7, arm=1)
    assert (rig.drive.state, rig.output.setpoint) == ("OE", 0)
    rig.drive.bits = 0x1000
    assert rig.run(1).output.setpoint == 123
    rig.drive.bits = 0
    assert rig.run(1).output.setpoint == 0
    assert explain(rig.run(DEADLINES.follow).state) == "FOLLOW took too long"
    rig = DriveLoop(Drive(), params)
    rig.drive.mode_display = 1
    assert rig.run(12, arm=1, mode=1).output.acting == 1  # bit 12 means another thing here


def test_a_statusword_is_fresh_up_to_its_limit() -> None:
    for age in (0.0, PARAMS.max_status_age):
        assert DriveLoop(Drive()).up().run(3, age=age).output.acting == 1


def test_invalid_parameters_are_named() -> None:
    assert state_machine.find_problems(PARAMS) == ()
    bad = PARAMS._replace(
        max_status_age=math.nan, reset_ticks=0, deadlines=DEADLINES._replace(mode=0, fault_reset=0)
    )
    named = [text.split(":")[0] for text in state_machine.find_problems(bad)]
    assert named == ["stale", "reset_ticks", "fault_reset", "mode", "fault_reset"]
    assert state_machine.find_problems(PARAMS._replace(reset_ticks=6))
    assert state_machine.find_problems(PARAMS._replace(max_status_age=0.0))
    assert list(Deadlines._fields) == [awaited.name.lower() for awaited in Awaited]


@pytest.mark.parametrize("goal", [-1, 4, 99])
def test_an_invalid_goal_is_safe(goal: int) -> None:
    rig = DriveLoop(Drive()).up().run(4, goal=goal)
    assert (rig.output.controlword, rig.drive.state) == (0, "SOD")
