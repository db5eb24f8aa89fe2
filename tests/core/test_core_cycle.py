"""The cycle composed for a one-axis and a two-axis rig, run by the real loop."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import pytest
from core_kinds import AXIS, BENCH, LAW, PAIR, PairParams, PairRow, PairSense, Table
from core_runs import SAFETY, SHORT, RunResult, Slider, Sliders, bench, bench_params, plan, run

from controllers.signals import AxisSense, Demand, Estimate
from rig.realtime import axis, cycle, safety
from rig.realtime.limits import LimitFlag, WarningFlag
from rig.realtime.reasons import Reason
from rig.realtime.safety import (
    ENABLING,
    OFF,
    REQUEST_HOLD,
    REQUEST_RESUME,
    REQUEST_STOP,
    RUN,
    STOP_0,
    STOP_1,
    STOP_2,
)
from rig.realtime.sequence import Phase
from rig.recording.ring import ProducerState
from rig.recording.row_layout import leaves, schema


def wave(amplitude: float, f: float = 2.0) -> Callable[[float], float]:
    return lambda t: amplitude * math.sin(2.0 * math.pi * f * t)


GAINS = Table((-100.0, -200.0), (0.0, 50.0))


def pair_params(surge: Table = GAINS, surge_axis: axis.Params = AXIS) -> cycle.Params:
    return cycle.Params(SHORT, SAFETY, 10, PairParams(AXIS, surge_axis, GAINS, surge))


def pair(heave: float = 20.0, surge: float = 30.0) -> Sliders:
    return Sliders(PairSense, Slider(wave(heave)), Slider(wave(surge, 3.0)))


def check_whole(result: RunResult) -> None:
    """Check that ticks have no gaps, first and last tick agree, and the run ended as planned."""
    assert result.error is None
    assert result.end is not None
    assert result.end.reason == Reason.PLAN_END
    assert result.state == ProducerState.FINISHED
    assert [row.tick for row in result.rows] == list(range(result.end.ticks))
    assert all(row.tick == row.tick_end for row in result.rows)
    assert [row.time for row in result.rows] == [row.tick * 0.001 for row in result.rows]


@pytest.mark.parametrize("kind", [BENCH, PAIR], ids=lambda kind: kind.row_type.__name__)
def test_the_schema_of_each_row_type_lists_its_leaves(kind: cycle.Kind) -> None:
    assert schema(kind.row_type).leaves == leaves(kind.row_type)


def test_a_bench_runs_its_plan() -> None:
    result = run(BENCH, bench_params(), bench(wave(20.0)))
    check_whole(result)
    phases = [row.plan.phase for row in result.rows]
    lengths = {phase: phases.count(phase) for phase in Phase}
    # the drive takes 30 ticks to enable, one more until that is read, one until it counts
    assert lengths[Phase.TARE] == 20
    assert 30 <= lengths[Phase.MOVING] <= 34
    assert lengths[Phase.LEAD_IN] == 40
    assert lengths[Phase.SETTLE] == 120
    assert lengths[Phase.MEASURE] == 200
    assert lengths[Phase.TAIL] == 5
    modes = [row.safety.mode for row in result.rows]
    order = [mode for i, mode in enumerate(modes) if i == 0 or mode != modes[i - 1]]
    assert order == [OFF, ENABLING, RUN, STOP_1, STOP_0]
    assert modes.count(STOP_1) == SAFETY.stop_ticks
    assert [row.safety.entered for row in result.rows] == [modes.index(mode) for mode in modes]
    ended = [row.safety.reason for row in result.rows if row.safety.mode >= STOP_1]
    assert {row.safety.reason for row in result.rows if row.safety.mode < STOP_1} == {Reason.NONE}
    assert set(ended) == {Reason.PLAN_END}
    measured = {
        row.plan.row: row.axis.demand for row in result.rows if row.plan.phase == Phase.MEASURE
    }
    assert {row: tuple(demand[:2]) for row, demand in measured.items()} == {
        0: (-100.0, 0.0),
        1: (-200.0, 50.0),
    }


def test_force_is_granted_only_in_modes_with_power() -> None:
    result = run(BENCH, bench_params(), bench(wave(20.0)))
    check_whole(result)
    for row in result.rows:
        if row.safety.mode in (OFF, ENABLING, STOP_0):
            assert row.axis.command[:2] == (0.0, 0.0)
        assert row.axis.command.enable == int(ENABLING <= row.safety.mode <= STOP_1)
    assert any(row.axis.command.force for row in result.rows if row.safety.mode == RUN)
    assert any(row.axis.command.force for row in result.rows if row.safety.mode == STOP_1)


def test_the_wave_clock_starts_with_the_lead_in() -> None:
    result = run(BENCH, bench_params(), bench())
    first = next(row.tick for row in result.rows if row.plan.phase == Phase.LEAD_IN)
    for row in result.rows:
        running = (
            row.tick >= first and row.plan.phase != Phase.DONE
        )  # then the wave maker is stopped
        expected = (row.tick - first) * 0.001 if running else -1.0
        assert row.plan.wave_clock == expected


def test_the_wave_clock_may_start_in_the_first_tick() -> None:
    segments = plan((0, Phase.SETTLE, 20, 0, 0), (0, Phase.MEASURE, 60, 0, 0))
    result = run(BENCH, bench_params(segments), bench())
    assert result.error is None
    clocks = [row.plan.wave_clock for row in result.rows if row.plan.phase != Phase.DONE]
    assert clocks[:80] == [k * 0.001 for k in range(80)]


def test_two_runs_are_equal_to_the_bit() -> None:
    first_run, second = (run(PAIR, pair_params(), pair()) for _ in range(2))
    assert first_run.rows == second.rows
    assert len(first_run.rows) > 400


def test_a_pair_runs_its_plan_and_both_axes_work() -> None:
    result = run(PAIR, pair_params(), pair())
    check_whole(result)
    assert isinstance(result.rows[0], PairRow)
    for name in ("heave", "surge"):
        run_rows = [row for row in result.rows if row.safety.mode == RUN]
        forces = [getattr(row, name).command.force for row in run_rows]
        assert max(forces) > 1.0
        assert min(forces) < -1.0
    for row in result.rows:
        between = row.surge.estimate.position - row.heave.estimate.position
        assert row.offset.between == between
        assert row.offset.both_on == int(ENABLING <= row.safety.mode <= STOP_1)


def test_a_saturated_surge_does_not_change_heave() -> None:
    mild = run(PAIR, pair_params(), pair())
    far = AXIS._replace(limits=AXIS.limits._replace(position_stop=9.0, velocity_stop=99.0))
    wild_gains = Table((-9000.0, -9000.0), (0.0, 0.0))
    wild = run(PAIR, pair_params(wild_gains, far), pair(surge=600.0))
    check_whole(mild)
    check_whole(wild)
    assert [row.heave for row in wild.rows] == [row.heave for row in mild.rows]
    flags = {row.surge.command.limited for row in wild.rows}
    assert any(flag & (LimitFlag.CURRENT_PEAK | LimitFlag.CURRENT_RMS) for flag in flags)
    assert any(flag & LimitFlag.SLEW for flag in flags)
    assert {row.heave.command.limited for row in wild.rows} == {0}
    assert [row.surge for row in wild.rows] != [row.surge for row in mild.rows]


def test_axes_can_be_swapped() -> None:
    """Heave and surge respond alike to the same external force."""
    result = run(PAIR, pair_params(), Sliders(PairSense, Slider(wave(20.0)), Slider(wave(35.0))))
    swapped = run(PAIR, pair_params(), Sliders(PairSense, Slider(wave(35.0)), Slider(wave(20.0))))
    assert [row.heave for row in result.rows] == [row.surge for row in swapped.rows]
    assert [row.surge for row in result.rows] == [row.heave for row in swapped.rows]


@pytest.mark.parametrize("which", [0, 1])
def test_a_fault_of_one_axis_stops_both(which: int) -> None:
    devices = pair()
    plain = devices.read

    def read(now: float) -> PairSense:
        if round(now / 0.001) == 200:
            devices.axes[which].fault = 1
        return plain(now)

    devices.read = read
    result = run(PAIR, pair_params(), devices)
    assert result.end is not None
    assert result.end.reason == Reason.DRIVE_FAULT
    for row in result.rows:
        if row.tick < 200:
            assert row.safety.mode != STOP_0
        else:
            assert row.safety.mode == STOP_0
            assert row.heave.command[:3] == row.surge.command[:3] == (0.0, 0.0, 0)
    assert devices.stops == [Reason.DRIVE_FAULT] * 5


@pytest.mark.parametrize("which", [0, 1])
def test_a_body_driven_beyond_its_stop_is_damped_then_released(which: int) -> None:
    pushes = [wave(20.0), wave(20.0)]
    pushes[which] = lambda t: 60.0
    devices = Sliders(PairSense, Slider(pushes[0]), Slider(pushes[1]))
    near = AXIS._replace(limits=AXIS.limits._replace(position_warn=0.1, position_stop=0.15))
    none = Table((0.0, 0.0), (0.0, 0.0))
    params = cycle.Params(SHORT, SAFETY, 10, PairParams(near, near, none, none))
    result = run(PAIR, params, devices)
    assert result.end is not None
    assert result.end.reason == Reason.POSITION
    tripped = next(row for row in result.rows if row.safety.mode == STOP_1)
    axes = (tripped.heave, tripped.surge)
    assert abs(axes[which].estimate.position) > 0.15
    assert abs(axes[1 - which].estimate.position) < 0.15
    assert axes[which].warned == WarningFlag.POSITION
    first = next(row for row in result.rows if row.heave.warned or row.surge.warned)
    assert first.tick < tripped.tick
    for row in result.rows:
        for axis_record in (row.heave, row.surge):
            beyond = abs(axis_record.estimate.position) > near.limits.position_warn
            assert axis_record.warned == (WarningFlag.POSITION if beyond else 0)
    both = [(row.heave, row.surge)[1 - which].warned for row in result.rows]
    assert set(both) == {0}  # the other axis has no warning
    assert [row.safety.mode for row in result.rows].count(STOP_1) == SAFETY.stop_ticks
    for row in result.rows:
        if row.safety.mode == STOP_1:
            axis_record = (row.heave, row.surge)[which]
            assert (
                axis_record.command.force * axis_record.estimate.velocity <= 0.0
            )  # damping dissipates energy


def test_the_drives_of_both_axes_are_waited_for() -> None:
    devices = pair()
    devices.axes[1].enable_ticks = 90
    result = run(PAIR, pair_params(), devices)
    check_whole(result)
    running = next(row for row in result.rows if row.safety.mode == RUN)
    assert running.heave.sense.enabled == running.surge.sense.enabled == 1
    assert running.tick >= 20 + 90


def test_the_law_demands_nothing_without_power() -> None:
    """It restarts there, so the gains of a later start grow from zero."""
    result = run(BENCH, bench_params(), bench(wave(20.0)))
    idle = [row for row in result.rows if row.safety.mode in (OFF, ENABLING, STOP_0)]
    assert {tuple(row.axis.demand) for row in idle} == {(0.0, 0.0, 0.0, 0.0)}
    first = next(row for row in result.rows if row.safety.mode == RUN)
    ramp = LAW.ramp / 0.001
    assert first.axis.demand.kp == pytest.approx(GAINS.kp[0] / ramp)


def test_in_a_stop_the_force_fades_to_pure_damping() -> None:
    """By hand: F = -D v + s (F_last + D v), with s falling from 1 to 0 during the stop's ramp."""
    params = bench_params(safety=SAFETY._replace(stop_ticks=120))
    result = run(BENCH, params, bench(wave(20.0)))
    rows = result.rows
    begin = next(i for i, row in enumerate(rows) if row.safety.mode == STOP_1)
    last = rows[begin - 1].axis.command.force
    assert abs(last) > 1.0
    stop = [row.axis for row in rows if row.safety.mode == STOP_1]
    assert len(stop) == 120
    for k, one in enumerate(stop, start=1):
        share = max(0.0, 1.0 - k * 0.001 / AXIS.stop_ramp)
        pure = -AXIS.stop_damping * one.estimate.velocity
        assert one.demand[:3] == (-AXIS.stop_damping, 0.0, 0.0)
        assert one.demand.force == pytest.approx(pure + share * (last - pure), abs=1e-9)


def test_a_change_between_law_and_stop_is_bumpless() -> None:
    """The force continues from its last value, at any demand of the law."""
    sense, motion = AxisSense(1000, 0.0, 0.0, 1, 0, 0.0), Estimate(0.01, 0.1, 0.0)
    memory, forces = axis.start(), []
    demand = Demand(0.0, 0.0, 0.0, 200.0)
    free = AXIS._replace(limits=AXIS.limits._replace(force_slew=1e9))
    for mode in [RUN] * 60 + [STOP_2] * 60 + [RUN] * 60 + [STOP_1] * 60:
        memory, record = axis.control(free, memory, sense, motion, demand, 1, 0, mode, 0.001)
        forces.append(record.command.force)
    pure = -free.stop_damping * 0.1
    max_step = (200.0 - pure) * 0.001 / free.stop_ramp
    steps = [abs(b - a) for a, b in itertools.pairwise([0.0, *forces])]
    assert max(steps) <= max_step * (1.0 + 1e-9)
    assert forces[59] == forces[179] == pytest.approx(200.0)
    assert forces[119] == forces[239] == pytest.approx(pure)


def test_a_resting_power_stage_is_granted_no_force() -> None:
    sense, motion = AxisSense(1000, 0.0, 0.0, 1, 0, 0.0), Estimate(0.01, 0.1, 0.0)
    running = axis.start()._replace(demand_source=RUN)
    demand = Demand(0.0, 0.0, 0.0, 20.0)
    memory, record = axis.control(AXIS, running, sense, motion, demand, 0, 0, RUN, 0.001)
    assert record.command == (0.0, 0.0, 1, LimitFlag.GATED)
    assert record.demand is demand
    assert memory.saturation_deficit == -20.0
    # A stop brakes, whatever the thresholds of the drive.
    _, record = axis.control(AXIS, memory, sense, motion, demand, 0, 0, STOP_1, 0.001)
    assert record.command.force < 0.0


def waves_in_each_mode(posts: dict[int, int]) -> dict[int, set[int]]:
    """Return for each mode whether the wave clock ran in it, as the rig kind sees it."""
    waves_by_mode: dict[int, set[int]] = {}

    def control(
        params: Any,
        state: Any,
        sense: Any,
        motion: Any,
        plan: cycle.PlanRecord,
        safety_state: safety.State,
        *rest: Any,
    ) -> Any:
        assert plan.wave_clock == -1.0 or plan.wave_clock >= 0.0
        waves_by_mode.setdefault(safety_state.mode, set()).add(int(plan.wave_clock >= 0.0))
        return BENCH.control(params, state, sense, motion, plan, safety_state, *rest)

    result = run(BENCH._replace(control=control), bench_params(), bench(), requests=posts)
    assert result.error is None
    return waves_by_mode


def test_the_waves_continue_in_a_hold_and_end_with_a_stop() -> None:
    waves_by_mode = waves_in_each_mode({200: REQUEST_HOLD, 250: REQUEST_RESUME, 300: REQUEST_STOP})
    assert waves_by_mode[OFF] == waves_by_mode[ENABLING] == {0}
    assert waves_by_mode[RUN] == {1}
    assert waves_by_mode[STOP_2] == {1}
    assert waves_by_mode[STOP_1] == waves_by_mode[STOP_0] == {0}


def test_the_virtual_clock_logs_zero_timing() -> None:
    result = run(BENCH, bench_params(), bench())
    assert {tuple(row.timing) for row in result.rows} == {(0.0, 0.0, 0)}
