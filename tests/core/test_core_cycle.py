"""The cycle composed for a one-axis and a two-axis rig, run by the real loop."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import Any

import pytest
from core_kinds import AXIS, BENCH, LAW, PAIR, PairParams, PairRow, PairSense, Table
from core_runs import SAFETY, SHORT, Ran, Slider, Sliders, bench, bench_params, plan, run

from controllers.signals import AxisSense, Demand, Estimate
from rig.realtime import axis, cycle, safety
from rig.realtime.limits import Limited, Warned
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
    Reason,
)
from rig.realtime.sequence import Phase
from rig.recording.ring import Producer
from rig.recording.row_layout import leaves, leaves_of_schema, schema


def wave(amplitude: float, f: float = 2.0) -> Callable[[float], float]:
    return lambda t: amplitude * math.sin(2.0 * math.pi * f * t)


GAINS = Table((-100.0, -200.0), (0.0, 50.0))


def pair_params(surge: Table = GAINS, surge_axis: axis.Params = AXIS) -> cycle.Params:
    return cycle.Params(SHORT, SAFETY, 10, PairParams(AXIS, surge_axis, GAINS, surge))


def pair(heave: float = 20.0, surge: float = 30.0) -> Sliders:
    return Sliders(PairSense, Slider(wave(heave)), Slider(wave(surge, 3.0)))


def check_whole(made: Ran) -> None:
    """Ticks without gaps, first and last equal, the run's planned end."""
    assert made.error is None
    assert made.end is not None
    assert made.end.reason == Reason.PLAN_END
    assert made.state == Producer.FINISHED
    assert [row.tick for row in made.rows] == list(range(made.end.ticks))
    assert all(row.tick == row.tick_end for row in made.rows)
    assert [row.time for row in made.rows] == [row.tick * 0.001 for row in made.rows]


@pytest.mark.parametrize("kind", [BENCH, PAIR], ids=lambda kind: kind.row_type.__name__)
def test_the_row_of_each_kind_has_a_schema_that_says_its_leaves(kind: cycle.Kind) -> None:
    assert leaves_of_schema(schema(kind.row_type)) == leaves(kind.row_type)


def test_a_bench_walks_its_plan() -> None:
    made = run(BENCH, bench_params(), bench(wave(20.0)))
    check_whole(made)
    phases = [row.plan.phase for row in made.rows]
    lengths = {phase: phases.count(phase) for phase in Phase}
    # the drive takes 30 ticks once asked, one more until that is read, one until it counts
    assert lengths[Phase.TARE] == 20
    assert 30 <= lengths[Phase.MOVING] <= 34
    assert lengths[Phase.LEAD_IN] == 40
    assert lengths[Phase.SETTLE] == 120
    assert lengths[Phase.MEASURE] == 200
    assert lengths[Phase.TAIL] == 5
    modes = [row.safety.mode for row in made.rows]
    order = [mode for i, mode in enumerate(modes) if i == 0 or mode != modes[i - 1]]
    assert order == [OFF, ENABLING, RUN, STOP_1, STOP_0]
    assert modes.count(STOP_1) == SAFETY.stop_ticks
    assert [row.safety.entered for row in made.rows] == [modes.index(mode) for mode in modes]
    ended = [row.safety.reason for row in made.rows if row.safety.mode >= STOP_1]
    assert {row.safety.reason for row in made.rows if row.safety.mode < STOP_1} == {Reason.NONE}
    assert set(ended) == {Reason.PLAN_END}
    measured = {
        row.plan.row: row.axis.demand for row in made.rows if row.plan.phase == Phase.MEASURE
    }
    assert {row: tuple(demand[:2]) for row, demand in measured.items()} == {
        0: (-100.0, 0.0),
        1: (-200.0, 50.0),
    }


def test_force_is_granted_only_where_the_mode_says_so() -> None:
    made = run(BENCH, bench_params(), bench(wave(20.0)))
    check_whole(made)
    for row in made.rows:
        if row.safety.mode in (OFF, ENABLING, STOP_0):
            assert row.axis.command[:2] == (0.0, 0.0)
        assert row.axis.command.enable == int(ENABLING <= row.safety.mode <= STOP_1)
    assert any(row.axis.command.force for row in made.rows if row.safety.mode == RUN)
    assert any(row.axis.command.force for row in made.rows if row.safety.mode == STOP_1)


def test_the_wave_clock_starts_with_the_lead_in() -> None:
    made = run(BENCH, bench_params(), bench())
    first = next(row.tick for row in made.rows if row.plan.phase == Phase.LEAD_IN)
    for row in made.rows:
        running = row.tick >= first and row.plan.phase != Phase.DONE  # then the maker stands
        expected = (row.tick - first) * 0.001 if running else -1.0
        assert row.plan.wave_clock == expected


def test_waves_that_run_from_the_first_tick_have_their_zero_there() -> None:
    segments = plan((0, Phase.SETTLE, 20, 0, 0), (0, Phase.MEASURE, 60, 0, 0))
    made = run(BENCH, bench_params(segments), bench())
    assert made.error is None
    clocks = [row.plan.wave_clock for row in made.rows if row.plan.phase != Phase.DONE]
    assert clocks[:80] == [k * 0.001 for k in range(80)]


def test_two_runs_are_equal_to_the_bit() -> None:
    once, again = (run(PAIR, pair_params(), pair()) for _ in range(2))
    assert once.rows == again.rows
    assert len(once.rows) > 400


def test_a_pair_walks_its_plan_and_both_axes_work() -> None:
    made = run(PAIR, pair_params(), pair())
    check_whole(made)
    assert isinstance(made.rows[0], PairRow)
    for name in ("heave", "surge"):
        run_rows = [row for row in made.rows if row.safety.mode == RUN]
        forces = [getattr(row, name).command.force for row in run_rows]
        assert max(forces) > 1.0
        assert min(forces) < -1.0
    for row in made.rows:
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
    assert any(flag & (Limited.CURRENT_PEAK | Limited.CURRENT_RMS) for flag in flags)
    assert any(flag & Limited.SLEW for flag in flags)
    assert {row.heave.command.limited for row in wild.rows} == {0}
    assert [row.surge for row in wild.rows] != [row.surge for row in mild.rows]


def test_axes_can_be_swapped() -> None:
    """What heave does with one push, surge does with the same push."""
    made = run(PAIR, pair_params(), Sliders(PairSense, Slider(wave(20.0)), Slider(wave(35.0))))
    swapped = run(PAIR, pair_params(), Sliders(PairSense, Slider(wave(35.0)), Slider(wave(20.0))))
    assert [row.heave for row in made.rows] == [row.surge for row in swapped.rows]
    assert [row.surge for row in made.rows] == [row.heave for row in swapped.rows]


@pytest.mark.parametrize("which", [0, 1])
def test_a_fault_of_one_axis_stops_both(which: int) -> None:
    devices = pair()
    plain = devices.read

    def read(now: float) -> PairSense:
        if round(now / 0.001) == 200:
            devices.axes[which].fault = 1
        return plain(now)

    devices.read = read
    made = run(PAIR, pair_params(), devices)
    assert made.end is not None
    assert made.end.reason == Reason.DRIVE_FAULT
    for row in made.rows:
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
    made = run(PAIR, params, devices)
    assert made.end is not None
    assert made.end.reason == Reason.POSITION
    tripped = next(row for row in made.rows if row.safety.mode == STOP_1)
    words = (tripped.heave, tripped.surge)
    assert abs(words[which].estimate.position) > 0.15
    assert abs(words[1 - which].estimate.position) < 0.15
    assert words[which].warned == Warned.POSITION
    first = next(row for row in made.rows if row.heave.warned or row.surge.warned)
    assert first.tick < tripped.tick
    for row in made.rows:
        for word in (row.heave, row.surge):
            beyond = abs(word.estimate.position) > near.limits.position_warn
            assert word.warned == (Warned.POSITION if beyond else 0)
    both = [(row.heave, row.surge)[1 - which].warned for row in made.rows]
    assert set(both) == {0}  # the other axis has nothing to warn of
    assert [row.safety.mode for row in made.rows].count(STOP_1) == SAFETY.stop_ticks
    for row in made.rows:
        if row.safety.mode == STOP_1:
            word = (row.heave, row.surge)[which]
            assert word.command.force * word.estimate.velocity <= 0.0  # damping takes energy out


def test_the_drives_of_both_axes_are_waited_for() -> None:
    devices = pair()
    devices.axes[1].enable_ticks = 90
    made = run(PAIR, pair_params(), devices)
    check_whole(made)
    running = next(row for row in made.rows if row.safety.mode == RUN)
    assert running.heave.sense.enabled == running.surge.sense.enabled == 1
    assert running.tick >= 20 + 90


def test_outside_run_and_its_stops_the_law_asks_for_nothing() -> None:
    """It starts afresh there, so the gains of a later start grow from zero."""
    made = run(BENCH, bench_params(), bench(wave(20.0)))
    idle = [row for row in made.rows if row.safety.mode in (OFF, ENABLING, STOP_0)]
    assert {tuple(row.axis.demand) for row in idle} == {(0.0, 0.0, 0.0, 0.0)}
    first = next(row for row in made.rows if row.safety.mode == RUN)
    ramp = LAW.ramp / 0.001
    assert first.axis.demand.kp == pytest.approx(GAINS.kp[0] / ramp)


def test_in_a_stop_the_force_fades_to_pure_damping() -> None:
    """By hand: F = -D v + s (F_last + D v), s falling from 1 to 0 within the stop's ramp."""
    params = bench_params(safety=SAFETY._replace(stop_ticks=120))
    made = run(BENCH, params, bench(wave(20.0)))
    rows = made.rows
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


def test_a_change_between_law_and_stop_never_bumps_the_force() -> None:
    """Whatever the law asks for, the force goes on from where it was."""
    sense, motion = AxisSense(1000, 0.0, 0.0, 1, 0, 0.0), Estimate(0.01, 0.1, 0.0)
    memory, forces = axis.start(), []
    wanted = Demand(0.0, 0.0, 0.0, 200.0)
    free = AXIS._replace(limits=AXIS.limits._replace(force_slew=1e9))
    for mode in [RUN] * 60 + [STOP_2] * 60 + [RUN] * 60 + [STOP_1] * 60:
        memory, record = axis.control(free, memory, sense, motion, wanted, 1, 0, mode, 0.001)
        forces.append(record.command.force)
    pure = -free.stop_damping * 0.1
    most = (200.0 - pure) * 0.001 / free.stop_ramp
    steps = [abs(b - a) for a, b in itertools.pairwise([0.0, *forces])]
    assert max(steps) <= most * (1.0 + 1e-9)
    assert forces[59] == forces[179] == pytest.approx(200.0)
    assert forces[119] == forces[239] == pytest.approx(pure)


def test_a_resting_power_stage_is_granted_nothing_and_says_so() -> None:
    sense, motion = AxisSense(1000, 0.0, 0.0, 1, 0, 0.0), Estimate(0.01, 0.1, 0.0)
    running = axis.start()._replace(acting=RUN)
    wanted = Demand(0.0, 0.0, 0.0, 20.0)
    memory, record = axis.control(AXIS, running, sense, motion, wanted, 0, 0, RUN, 0.001)
    assert record.command == (0.0, 0.0, 1, Limited.GATED)
    assert record.demand is wanted
    assert memory.saturation_deficit == -20.0
    # A stop brakes, whatever the thresholds of the drive say.
    _, record = axis.control(AXIS, memory, sense, motion, wanted, 0, 0, STOP_1, 0.001)
    assert record.command.force < 0.0


def waves_seen(posts: dict[int, int]) -> dict[int, set[int]]:
    """For each mode whether the wave clock ran in it, in a kind that hears of it."""
    told: dict[int, set[int]] = {}

    def control(
        params: Any,
        state: Any,
        sense: Any,
        motion: Any,
        plan: cycle.PlanRecord,
        guard: safety.State,
        *rest: Any,
    ) -> Any:
        assert plan.wave_clock == -1.0 or plan.wave_clock >= 0.0
        told.setdefault(guard.mode, set()).add(int(plan.wave_clock >= 0.0))
        return BENCH.control(params, state, sense, motion, plan, guard, *rest)

    made = run(BENCH._replace(control=control), bench_params(), bench(), posts=posts)
    assert made.error is None
    return told


def test_the_waves_go_on_in_a_hold_and_end_with_a_stop() -> None:
    told = waves_seen({200: REQUEST_HOLD, 250: REQUEST_RESUME, 300: REQUEST_STOP})
    assert told[OFF] == told[ENABLING] == {0}
    assert told[RUN] == {1}
    assert told[STOP_2] == {1}
    assert told[STOP_1] == told[STOP_0] == {0}


def test_the_virtual_clock_has_no_timing_to_tell() -> None:
    made = run(BENCH, bench_params(), bench())
    assert {tuple(row.timing) for row in made.rows} == {(0.0, 0.0, 0)}
