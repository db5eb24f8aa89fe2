"""Two small kinds of rig, one axis and two axes, built of the same pieces as the WaveBot.

Nothing here needs numpy, so the loop's import closure can be looked at with these kinds too.
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
from rig.realtime.safety import FINE, RUN
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
    gains: Table


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


class Driven(NamedTuple):
    """An axis and the law that moves it."""

    axis: axis.State
    law: impedance.State


def _driven_start(params: Any) -> Driven:
    return Driven(axis.start(), impedance.start())


def _driven(
    params: axis.Params,
    state: Driven,
    sense: AxisSense,
    motion: Estimate,
    table: Table,
    setpoint: int,
    mode: int,
    dt: float,
) -> tuple[Driven, axis.Record]:
    law, wanted = impedance.start(), axis.NOTHING
    if mode == RUN:
        gains = Gains(table.kp[setpoint], table.ki[setpoint], 0.0)
        law, wanted = impedance.step(LAW, state.law, gains, motion, 0.0, 0.0, dt)
    after, record = axis.control(params, state.axis, sense, motion, wanted, 1, 0, mode, dt)
    return Driven(after, law), record


def _bench_observe(
    params: BenchParams, state: Driven, sense: BenchSense, periods: int, dt: float
) -> Estimate:
    return axis.observe(params.axis, state.axis, sense.axis, 0.0, periods, dt)


def _bench_ready(params: BenchParams, state: Driven, sense: BenchSense) -> int:
    return WAIT_DRIVE if sense.axis.enabled == 1 else 0


def _bench_check(
    params: BenchParams, state: Driven, sense: BenchSense, motion: Estimate, mode: int
) -> int:
    return axis.check(params.axis, state.axis, sense.axis, motion, 0.0, mode)


def _bench_control(
    params: BenchParams,
    state: Driven,
    sense: BenchSense,
    motion: Estimate,
    plan: cycle.PlanRecord,
    guard: safety.State,
    setpoint: int,
    dt: float,
) -> tuple[Driven, BenchCommand, axis.Record]:
    after, record = _driven(
        params.axis, state, sense.axis, motion, params.gains, setpoint, guard.mode, dt
    )
    return after, BenchCommand(record.command), record


def _bench_row(
    tick: int,
    time: float,
    timing: cycle.Timing,
    plan: cycle.PlanRecord,
    guard: safety.State,
    sense: BenchSense,
    command: BenchCommand,
    words: axis.Record,
) -> BenchRow:
    return BenchRow(tick, time, timing, plan, guard, words, tick)


BENCH = cycle.Kind(
    BenchRow,
    BenchParams,
    _driven_start,
    _bench_observe,
    _bench_ready,
    _bench_check,
    _bench_control,
    _bench_row,
)


# --- two axes: heave and surge


class PairParams(NamedTuple):
    heave: axis.Params
    surge: axis.Params
    heave_gains: Table
    surge_gains: Table


class PairState(NamedTuple):
    heave: Driven
    surge: Driven


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
    """A word of this kind's own."""

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
    return PairState(_driven_start(params), _driven_start(params))


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
        axis.check(part, memory.axis, word, moving, 0.0, mode)
        for part, memory, word, moving in zip(params[:2], state, sense, motion, strict=True)
    ]
    faults = [reason for reason in found if reason != FINE]
    return min(faults, key=lambda reason: safety.CATEGORY[reason], default=FINE)


def _pair_control(
    params: PairParams,
    state: PairState,
    sense: PairSense,
    motion: PairMotion,
    plan: cycle.PlanRecord,
    guard: safety.State,
    setpoint: int,
    dt: float,
) -> tuple[PairState, PairCommand, tuple[axis.Record, axis.Record, Offset]]:
    states, records = [], []
    for part, memory, word, moving, table in zip(
        params[:2], state, sense, motion, params[2:], strict=True
    ):
        after, record = _driven(part, memory, word, moving, table, setpoint, guard.mode, dt)
        states.append(after)
        records.append(record)
    heave, surge = records
    between = motion.surge.position - motion.heave.position
    both = heave.command.enable & surge.command.enable
    words = (heave, surge, Offset(between, setpoint, both))
    return PairState(*states), PairCommand(heave.command, surge.command), words


def _pair_row(
    tick: int,
    time: float,
    timing: cycle.Timing,
    plan: cycle.PlanRecord,
    guard: safety.State,
    sense: PairSense,
    command: PairCommand,
    words: tuple[axis.Record, axis.Record, Offset],
) -> PairRow:
    return PairRow(tick, time, timing, plan, guard, *words, tick)


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
