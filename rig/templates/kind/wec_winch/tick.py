"""The loop's part of the rig: one axis that is held at the goal of the row."""

from enum import IntEnum
from typing import NamedTuple

from controllers.signals import AxisCommand, AxisSense, Estimate, Metre, Second, Tick
from rig.realtime import axis, cycle, safety
from rig.realtime.reasons import NO_REASON, trip_reason
from rig.realtime.safety import RUN
from rig.realtime.sequence import TARE, WAIT_DRIVE

from wec_winch import law


class OwnReason(IntEnum):
    """Numbers of the kind's own reasons."""

    LINE_SLACK = 100


REASONS = (trip_reason(OwnReason.LINE_SLACK, 1, "the line was slack"),)


class Setpoints(NamedTuple):
    goal: tuple[float, ...]  # m


class Params(NamedTuple):
    axis: axis.Params
    law: law.Params
    slack_stop: float  # m above the zero
    setpoints: Setpoints


class State(NamedTuple):
    axis: axis.State
    law: law.State
    zero: float  # m
    seeded: int  # 1 once there is a zero


class Sense(NamedTuple):
    axis: AxisSense


SENSE_IN_ROW = {"axis": "axis.sense"}


class Command(NamedTuple):
    axis: AxisCommand


class Goal(NamedTuple):
    position: Metre


class Row(NamedTuple):
    tick: Tick
    time: Second
    timing: cycle.Timing
    plan: cycle.PlanRecord
    safety: safety.State
    axis: axis.Record
    goal: Goal
    tick_end: Tick


def start(params: Params) -> State:
    return State(axis.start(), law.start(params.law), 0.0, 0)


def _zero(params: Params, state: State, sense: Sense) -> float:
    return state.zero if state.seeded else sense.axis.counts * params.axis.metres_per_count


def observe(params: Params, state: State, sense: Sense, periods: int, dt: float) -> Estimate:
    zero = _zero(params, state, sense)
    return axis.observe(params.axis, state.axis, sense.axis, zero, periods, dt)


def ready(params: Params, state: State, sense: Sense) -> int:
    return WAIT_DRIVE if sense.axis.enabled == 1 else 0


def check(params: Params, state: State, sense: Sense, motion: Estimate, mode: int) -> int:
    zero = _zero(params, state, sense)
    reason = axis.check(params.axis, state.axis, sense.axis, motion, zero, mode)
    if reason == NO_REASON and motion.position > params.slack_stop:
        return OwnReason.LINE_SLACK.value
    return reason


def control(params, state, sense, motion, plan, guard, setpoint, dt):  # type: ignore[no-untyped-def]
    goal, memory, demand = params.setpoints.goal[setpoint], law.start(params.law), axis.NO_DEMAND
    if guard.mode == RUN:
        deficit = state.axis.saturation_deficit
        at = law.SetPoint(goal)
        memory, demand = law.step(params.law, state.law, at, motion, 0.0, deficit, dt)
    after, record = axis.control(
        params.axis, state.axis, sense.axis, motion, demand, 1, 0, guard.mode, dt
    )
    seeded = 1 if plan.phase == TARE or state.seeded else 0
    new = State(after, memory, _zero(params, state, sense), seeded)
    return new, Command(record.command), (record, Goal(goal))


def row(tick, time, timing, plan, guard, sense, command, signals):  # type: ignore[no-untyped-def]
    record, goal = signals
    return Row(tick, time, timing, plan, guard, record, goal, tick)


KIND = cycle.Kind(
    Row, Params, start, observe, ready, check, control, row, reasons=REASONS, sense_type=Sense
)


def find_kind(law: str) -> cycle.Kind:
    return KIND
