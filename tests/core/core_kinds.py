"""Two small rig kinds with one and two axes, built from the same parts as the WaveBot.

Nothing here needs numpy, so they also serve the test of the loop's import closure.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from controllers import estimator, impedance
from controllers.signals import (
    AxisCommand,
    AxisSense,
    Estimate,
    Flag,
    Gains,
    Index,
    Metre,
    Second,
    Tick,
)
from rig.realtime import axis, cycle, limits, safety
from rig.realtime.safety import NO_REASON, RUN
from rig.realtime.sequence import WAIT_DRIVE

DT = 0.001
LAW = impedance.Params(ramp=0.1)
SCALE = 1e-5  # m per count

LIMITS = limits.AxisLimits(
    position_warn=0.2,
    position_stop=0.25,
    velocity_stop=1.0,
    current_peak=10.0,
    current_rms=5.0,
    current_rms_time=1.0,
    force_slew=50_000.0,
    encoder_age_stop=0.02,
    encoder_jump_stop=0.05,
    drive_age_stop=0.1,
    current_difference_stop=1.0,
    current_ticks_stop=20,
    newtons_per_ampere=50.0,
)

AXIS = axis.Params(
    metres_per_count=SCALE,
    estimator=estimator.Params(0.2, 20.0, 1000.0),
    limits=LIMITS,
    stop_damping=300.0,
    stop_ramp=0.02,
)


class Table(NamedTuple):
    """Gains by columns, one entry a set point."""

    kp: tuple[float, ...]
    ki: tuple[float, ...]


# --- one axis: a bench dynamometer


class BenchParams(NamedTuple):
    axis: axis.Params
    setpoints: Table


class BenchSense(NamedTuple):
    axis: AxisSense


class BenchCommand(NamedTuple):
    axis: AxisCommand


class BenchRow(NamedTuple):
    tick: Tick
    time: Second
    timing: cycle.Timing
    plan: cycle.PlanRecord
    safety: safety.State
    axis: axis.Record
    tick_end: Tick


class DrivenAxis(NamedTuple):
    """An axis and its control law."""

    axis: axis.State
    law: impedance.State


def _start_axis(params: Any) -> DrivenAxis:
    return DrivenAxis(axis.start(), impedance.start(LAW))


def _step_axis(
    params: axis.Params,
    state: DrivenAxis,
    sense: AxisSense,
    motion: Estimate,
    table: Table,
    setpoint: int,
    mode: int,
    dt: float,
) -> tuple[DrivenAxis, axis.Record]:
    law, demand = impedance.start(LAW), axis.NO_DEMAND
    if mode == RUN:
        gains = Gains(table.kp[setpoint], table.ki[setpoint], 0.0)
        law, demand = impedance.step(LAW, state.law, gains, motion, 0.0, 0.0, dt)
    after, record = axis.control(params, state.axis, sense, motion, demand, 1, 0, mode, dt)
    return DrivenAxis(after, law), record


def _bench_observe(
    params: BenchParams, state: DrivenAxis, sense: BenchSense, periods: int, dt: float
) -> Estimate:
    return axis.observe(params.axis, state.axis, sense.axis, 0.0, periods, dt)


def _bench_ready(params: BenchParams, state: DrivenAxis, sense: BenchSense) -> int:
    return WAIT_DRIVE if sense.axis.enabled == 1 else 0


def _bench_check(
    params: BenchParams, state: DrivenAxis, sense: BenchSense, motion: Estimate, mode: int
) -> int:
    return axis.check(params.axis, state.axis, sense.axis, motion, 0.0, mode)


def _bench_control(
    params: BenchParams,
    state: DrivenAxis,
    sense: BenchSense,
    motion: Estimate,
    plan: cycle.PlanRecord,
    safety_state: safety.State,
    setpoint: int,
    dt: float,
) -> tuple[DrivenAxis, BenchCommand, axis.Record]:
    after, record = _step_axis(
        params.axis, state, sense.axis, motion, params.setpoints, setpoint, safety_state.mode, dt
    )
    return after, BenchCommand(record.command), record


def _bench_row(
    tick: int,
    time: float,
    timing: cycle.Timing,
    plan: cycle.PlanRecord,
    safety_state: safety.State,
    sense: BenchSense,
    command: BenchCommand,
    records: axis.Record,
) -> BenchRow:
    return BenchRow(tick, time, timing, plan, safety_state, records, tick)


BENCH = cycle.Kind(
    BenchRow,
    BenchParams,
    _start_axis,
    _bench_observe,
    _bench_ready,
    _bench_check,
    _bench_control,
    _bench_row,
    sense_type=BenchSense,
)


def find_kind(law: str) -> cycle.Kind:
    """Return the bench, as the package of a kind's tick does; it has one law."""
    return BENCH


# --- two axes: heave and surge


class PairParams(NamedTuple):
    heave: axis.Params
    surge: axis.Params
    heave_gains: Table
    surge_gains: Table


class PairState(NamedTuple):
    heave: DrivenAxis
    surge: DrivenAxis


class PairSense(NamedTuple):
    heave: AxisSense
    surge: AxisSense


class PairCommand(NamedTuple):
    heave: AxisCommand
    surge: AxisCommand


class PairMotion(NamedTuple):
    heave: Estimate
    surge: Estimate


class Offset(NamedTuple):
    """A signal that only this kind has."""

    between: Metre  # surge minus heave
    setpoint: Index
    both_on: Flag


class PairRow(NamedTuple):
    tick: Tick
    time: Second
    timing: cycle.Timing
    plan: cycle.PlanRecord
    safety: safety.State
    heave: axis.Record
    surge: axis.Record
    offset: Offset
    tick_end: Tick


def _pair_start(params: PairParams) -> PairState:
    return PairState(_start_axis(params), _start_axis(params))


def _pair_observe(
    params: PairParams, state: PairState, sense: PairSense, periods: int, dt: float
) -> PairMotion:
    return PairMotion(
        axis.observe(params.heave, state.heave.axis, sense.heave, 0.0, periods, dt),
        axis.observe(params.surge, state.surge.axis, sense.surge, 0.0, periods, dt),
    )


def _pair_ready(params: PairParams, state: PairState, sense: PairSense) -> int:
    return WAIT_DRIVE if sense.heave.enabled == 1 and sense.surge.enabled == 1 else 0


def _pair_check(
    params: PairParams, state: PairState, sense: PairSense, motion: PairMotion, mode: int
) -> int:
    found = [
        axis.check(part, memory.axis, sense_part, moving, 0.0, mode)
        for part, memory, sense_part, moving in zip(params[:2], state, sense, motion, strict=True)
    ]
    faults = [reason for reason in found if reason != NO_REASON]
    return min(faults, key=lambda reason: safety.CATEGORY[reason], default=NO_REASON)


def _pair_control(
    params: PairParams,
    state: PairState,
    sense: PairSense,
    motion: PairMotion,
    plan: cycle.PlanRecord,
    safety_state: safety.State,
    setpoint: int,
    dt: float,
) -> tuple[PairState, PairCommand, tuple[axis.Record, axis.Record, Offset]]:
    states, records = [], []
    for part, memory, sense_part, moving, table in zip(
        params[:2], state, sense, motion, params[2:], strict=True
    ):
        after, record = _step_axis(
            part, memory, sense_part, moving, table, setpoint, safety_state.mode, dt
        )
        states.append(after)
        records.append(record)
    heave, surge = records
    between = motion.surge.position - motion.heave.position
    both = heave.command.enable & surge.command.enable
    records = (heave, surge, Offset(between, setpoint, both))
    return PairState(*states), PairCommand(heave.command, surge.command), records


def _pair_row(
    tick: int,
    time: float,
    timing: cycle.Timing,
    plan: cycle.PlanRecord,
    safety_state: safety.State,
    sense: PairSense,
    command: PairCommand,
    records: tuple[axis.Record, axis.Record, Offset],
) -> PairRow:
    return PairRow(tick, time, timing, plan, safety_state, *records, tick)


PAIR = cycle.Kind(
    PairRow,
    PairParams,
    _pair_start,
    _pair_observe,
    _pair_ready,
    _pair_check,
    _pair_control,
    _pair_row,
)
