"""From counts to motion: sign, initial value and zero of one axis, and the WaveBot's tare."""

from __future__ import annotations

from typing import Any

import core_wavebot
import pytest
from core_kinds import AXIS, DT, SCALE
from core_runs import LossyClock, RunResult, plan, run
from core_wavebot import READY, ModifiedDevices, Quiet, params
from hypothesis import given
from hypothesis import strategies as st

from controllers import estimator
from controllers.signals import AxisSense, Demand, Estimate
from rig.kinds.wavebot import tick as wavebot
from rig.kinds.wavebot.tick import KIND, Sense, tare
from rig.realtime import axis, cycle, safety
from rig.realtime.clock import VirtualClock
from rig.realtime.limits import WarningFlag
from rig.realtime.reasons import Reason
from rig.realtime.safety import ENABLING, OFF, RUN, STOP_0, STOP_1, STOP_2
from rig.realtime.sequence import Phase

NONE = axis.NO_DEMAND
AT = 183264  # counts
COUNTS = st.integers(-(2**40), 2**40)
ZERO = st.floats(-10.0, 10.0)
SCALES = st.sampled_from([SCALE, -SCALE, 2.52e-5, -2.52e-5])


def axis_sense(counts: int) -> AxisSense:
    return AxisSense(counts, 0.0, 0.0, 1, 0, 0.0)


def axis_records(
    own: axis.Params, counts: list[int], zero: float = 0.0, mode: int = RUN
) -> list[axis.Record]:
    """Return the records of an axis for these counts, one a tick."""
    state, out = axis.start(), []
    for count in counts:
        sense = axis_sense(count)
        motion = axis.observe(own, state, sense, zero, 1, DT)
        state, record = axis.control(own, state, sense, motion, NONE, 1, 0, mode, DT)
        out.append(record)
    return out


# --- the initial value


@given(COUNTS, ZERO, SCALES, st.integers(1, 1000))
def test_the_first_count_initialises_the_position(
    counts: int, zero: float, scale: float, periods: int
) -> None:
    """The axis starts at rest there; a filter converging to it would show a velocity."""
    own = AXIS._replace(metres_per_count=scale)
    motion = axis.observe(own, axis.start(), axis_sense(counts), zero, periods, DT)
    assert motion == (counts * scale - zero, 0.0, 0.0)
    assert type(motion) is Estimate


@pytest.mark.parametrize("mode", [OFF, ENABLING, RUN, STOP_2, STOP_1, STOP_0])
def test_an_axis_at_rest_stays_at_rest(mode: int) -> None:
    records = axis_records(AXIS, [AT] * 100, mode=mode)
    assert {record.estimate for record in records} == {(AT * SCALE, 0.0, 0.0)}
    records = axis_records(AXIS, [AT] * 100, zero=AT * SCALE, mode=mode)
    assert {record.estimate for record in records} == {(0.0, 0.0, 0.0)}


@pytest.mark.parametrize("mode", [OFF, ENABLING, RUN, STOP_2, STOP_1, STOP_0])
def test_only_the_first_count_initialises_the_filter(mode: int) -> None:
    """In every mode the second count is filtered."""
    first, second = axis_records(AXIS, [AT, AT + 1000], mode=mode)
    expected = estimator.step(AXIS.estimator, first.estimate, (AT + 1000) * SCALE, 1, DT)
    assert second.estimate == expected
    assert second.estimate.velocity > 0.0
    assert AT * SCALE < second.estimate.position < (AT + 1000) * SCALE


def test_a_count_of_zero_initialises_the_filter_too() -> None:
    _, second = axis_records(AXIS, [0, 1000])
    assert second.estimate == estimator.step(
        AXIS.estimator, Estimate(0.0, 0.0, 0.0), 1000 * SCALE, 1, DT
    )


def test_the_switch_on_state_is_uninitialised() -> None:
    state = axis.start()
    assert (state.motion, state.demand_source) == ((0.0, 0.0, 0.0), axis.UNINITIALISED)


# --- the sign of the counts


def test_counts_that_grow_downwards_give_a_negative_velocity() -> None:
    counts = [AT + round(0.2 * k * DT / SCALE) for k in range(3000)]
    down = AXIS._replace(metres_per_count=-SCALE)
    up, fallen = axis_records(AXIS, counts), axis_records(down, counts)
    mirrored = axis_records(down, [-count for count in counts])
    assert up[-1].estimate.velocity == pytest.approx(0.2, rel=0.01)
    for one, other, same in zip(up, fallen, mirrored, strict=True):
        assert tuple(other.estimate) == tuple(-x for x in one.estimate)
        assert same.estimate == one.estimate


def test_lost_periods_are_predicted() -> None:
    before = axis.start()._replace(motion=Estimate(0.5, -0.2, 0.3), demand_source=RUN)
    sense = axis_sense(round(0.5 / SCALE) - 900)
    for periods in (1, 2, 50):
        motion = axis.observe(AXIS, before, sense, 0.1, periods, DT)
        measured = sense.counts * SCALE - 0.1
        assert motion == estimator.step(AXIS.estimator, before.motion, measured, periods, DT)


# --- a new zero


@given(st.lists(st.integers(-60, 60), min_size=2, max_size=60), ZERO, ZERO, st.data())
def test_a_new_zero_shifts_only_the_position(
    steps: list[int], zero: float, shift: float, data: Any
) -> None:
    """An axis whose zero moves continues like one that had the new zero from the start."""
    at = data.draw(st.integers(1, len(steps)))
    moved = one = axis.start()
    counts, here = AT, zero
    for k, more in enumerate([*steps, 0]):
        if k == at:
            moved, here = axis.rezero(moved, shift), zero + shift
        counts += more
        sense = axis_sense(counts)
        shifted = axis.observe(AXIS, moved, sense, here, 1, DT)
        plain = axis.observe(AXIS, one, sense, zero, 1, DT)
        assert shifted.position == pytest.approx(plain.position - (here - zero), abs=1e-11)
        assert shifted.velocity == pytest.approx(plain.velocity, abs=1e-9)
        assert shifted.acceleration == pytest.approx(plain.acceleration, abs=1e-7)
        moved, _ = axis.control(AXIS, moved, sense, shifted, NONE, 1, 0, RUN, DT)
        one, _ = axis.control(AXIS, one, sense, plain, NONE, 1, 0, RUN, DT)


def test_a_new_zero_keeps_all_other_memory() -> None:
    state, sense = axis.start(), axis_sense(AT)
    for mode in (RUN, RUN, STOP_2):
        motion = Estimate(0.02, 0.1, -0.3)
        demand = Demand(-500.0, 900.0, 0.0, -32.0)
        state, _ = axis.control(AXIS, state, sense, motion, demand, 1, 0, mode, DT)
    assert state.limits.force != 0.0
    assert state.demand_source == STOP_1
    assert 0.0 < state.fade_share < 1.0
    after = axis.rezero(state, 0.005)
    assert after == state._replace(motion=Estimate(0.02 - 0.005, 0.1, -0.3))
    assert after.limits is state.limits
    assert type(after) is axis.State
    assert (
        axis.rezero(axis.start(), 4.6).demand_source == axis.UNINITIALISED
    )  # no count has arrived yet


# --- the record


def test_the_record_holds_inputs_and_outputs() -> None:
    sense, motion = axis_sense(AT), Estimate(0.01, 0.1, 0.2)
    running = axis.start()._replace(demand_source=RUN)
    demand = Demand(-500.0, 0.0, 3.0, -49.4)
    state, record = axis.control(AXIS, running, sense, motion, demand, 1, 0, RUN, DT)
    assert record.sense is sense
    assert record.estimate is motion is state.motion
    assert record.demand is demand
    assert record.command.force == demand.force == state.limits.force
    assert record.command.enable == 1
    assert record.warned == 0


@pytest.mark.parametrize("mode", [OFF, ENABLING, RUN, STOP_2, STOP_1, STOP_0])
@pytest.mark.parametrize(
    ("position", "flag"), [(0.2, 0), (-0.2, 0), (0.2001, 1), (-0.2001, 1), (0.0, 0)]
)
def test_a_far_position_warns_in_every_mode(mode: int, position: float, flag: int) -> None:
    assert AXIS.limits.position_warn == 0.2
    motion = Estimate(position, 0.0, 0.0)
    _, record = axis.control(AXIS, axis.start(), axis_sense(0), motion, NONE, 1, 0, mode, DT)
    assert record.warned == flag == (WarningFlag.POSITION if flag else 0)
    assert type(record.warned) is int


# --- the tare of a WaveBot whose body creeps, as in any basin

TARE = (-1, Phase.TARE, 50, 0, 0)
MOVING = (-1, Phase.MOVING, 20, READY, 0)
PLANS = {
    "tared": plan(TARE, MOVING, (0, Phase.SETTLE, 150, 0, 0)),
    "tared twice": plan(TARE, MOVING, (-1, Phase.TARE, 40, 0, 0), (0, Phase.SETTLE, 110, 0, 0)),
    "not tared": plan(MOVING, (0, Phase.SETTLE, 200, 0, 0)),
}
CREEP = 1  # count a tick: 25 mm/s, 1.3 mm in a tare
QUICK = safety.Params(enable_ticks=50, stop_ticks=5)


def run_with_creep(name: str, scale: float, gaps: dict[int, int]) -> RunResult:
    """Run a rig whose body and string pot creep."""
    base = params(PLANS[name])._replace(safety=QUICK)
    heave = base.rig.heave._replace(metres_per_count=scale)
    own = base._replace(rig=base.rig._replace(heave=heave))

    def creep(tick: int, signals: Sense) -> Sense:
        shift = CREEP * tick
        return signals._replace(
            heave=signals.heave._replace(counts=signals.heave.counts + shift),
            load=signals.load._replace(string_pot=signals.load.string_pot + shift * scale),
        )

    result = run(KIND, own, ModifiedDevices(Quiet(), creep), clock=LossyClock(gaps))
    assert result.error is None
    assert result.end is not None
    assert result.end.reason == Reason.PLAN_END
    return result


@pytest.mark.parametrize("gaps", [{}, {50: 3}, {51: 3}, {40: 4, 52: 5}], ids=str)
@pytest.mark.parametrize("down", [1.0, -1.0])
@pytest.mark.parametrize("name", PLANS)
def test_the_end_of_a_tare_moves_only_the_zero(
    name: str, down: float, gaps: dict[int, int]
) -> None:
    """Every tick is compared with a filter in the encoder's own frame, without any zero."""
    shipped = params().rig.heave
    scale = down * shipped.metres_per_count
    rows = run_with_creep(name, scale, gaps).rows
    true = Estimate(rows[0].heave.sense.counts * scale, 0.0, 0.0)
    zero, last = true.position, 0  # initially the position of the body
    zeros = set()
    for i, row in enumerate(rows):
        if i:
            measured = row.heave.sense.counts * scale
            true = estimator.step(shipped.estimator, true, measured, row.tick - last, DT)
        x, v, a = row.heave.estimate
        assert x == pytest.approx(true.position - zero, abs=1e-11)
        assert v == pytest.approx(true.velocity, abs=1e-9)
        assert a == pytest.approx(true.acceleration, abs=1e-7)
        zero, last = row.tare.position, row.tick  # the zero in a row applies from the next tick on
        zeros.add(zero)
    assert len(zeros) == {"tared": 2, "tared twice": 3, "not tared": 1}[name]
    assert abs(true.velocity - CREEP * scale / DT) < 1e-4


@pytest.mark.parametrize("down", [1.0, -1.0])
@pytest.mark.parametrize("name", PLANS)
def test_the_zeros_are_means_of_the_sensed_values(name: str, down: float) -> None:
    scale = down * params().rig.heave.metres_per_count
    rows = run_with_creep(name, scale, {}).rows
    first, window = rows[0], []
    expected = (first.heave.sense.counts * scale, first.load.string_pot, 0)
    for row in rows:
        if row.plan.phase == Phase.TARE:
            window.append((row.heave.sense.counts * scale, row.load.string_pot))
        elif window:
            n = len(window)
            expected = (*(sum(column) / n for column in zip(*window, strict=True)), n)
            window = []
        zeros = (row.tare.position, row.tare.string_pot, row.tare.samples)
        assert zeros == pytest.approx(expected, abs=1e-12)


def test_a_tare_sets_the_zero_to_its_mean_position() -> None:
    """By hand: the body creeps 1 count a tick during a tare of 50 ticks, whose mean is 24.5."""
    scale = params().rig.heave.metres_per_count
    rows = run_with_creep("tared", scale, {}).rows
    assert rows[50].plan.phase == Phase.MOVING
    before, after = rows[50].heave.estimate, rows[51].heave.estimate
    assert before.position / scale == pytest.approx(50.0, abs=1.0)
    assert after.position / scale == pytest.approx(51.0 - 24.5, abs=1.0)
    assert after.velocity == pytest.approx(before.velocity, rel=0.02)


def test_the_first_tick_of_a_wavebot_sets_its_zero() -> None:
    for counts in (-500_000, 0, AT):
        quiet = Quiet().read(0.0)
        sense = quiet._replace(heave=quiet.heave._replace(counts=counts))
        motion = wavebot.observe(params().rig, wavebot.KIND.start(params().rig), sense, 1, DT)
        assert motion == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


# --- the plan's set points reach a WaveBot


def test_each_set_point_applies_its_gains_and_spring_rate() -> None:
    table = core_wavebot.table(
        (-2000.0, -1000.0, 0.0), (0.0, 1000.0, 500.0), (490.9, -2763.0, 490.9)
    )._replace(
        surge_kp=(-2500.0, -100.0, 0.0),
        surge_ki=(-1.0, 0.0, -2.0),
        stroke=(0.35, 0.2, 0.3),
        bus_voltage=(75.0, 40.0, 150.0),
        discharge_level=(1, 15, 3),
    )
    own = params(setpoints=table).rig
    own = own._replace(heave_law=own.heave_law._replace(ramp=DT))
    own = own._replace(station_keeping=own.station_keeping._replace(ramp=DT))
    state, sense = wavebot.KIND.start(own), Quiet().read(0.0)
    plan_record, safety_state = cycle.PlanRecord(0, Phase.SETTLE, 0, -1.0), safety.State(RUN, 0, 0)
    for setpoint in (0, 0, 1, 1, 2, 0, 2, 1, 0, 0):
        motion = wavebot.observe(own, state, sense, 1, DT)
        state, command, outputs = wavebot.KIND.control(
            own, state, sense, motion, plan_record, safety_state, setpoint, DT
        )
        heave, surge, *_ = outputs
        kp, ki, _, _ = heave.demand
        assert (kp, ki) == pytest.approx(tuple(column[setpoint] for column in table.law[:2]))
        kp, ki, _, _ = surge.demand
        assert (kp, ki) == pytest.approx((table.surge_kp[setpoint], table.surge_ki[setpoint]))
        assert command.spring.rate == table.spring_rate[setpoint]
        assert command.drive.settings.bus_voltage == table.bus_voltage[setpoint]
        assert command.drive.settings.discharge_level == table.discharge_level[setpoint]
        assert state.active_setpoint.setpoint == setpoint
        assert state.active_setpoint.stroke == table.stroke[setpoint]


def test_no_set_point_is_active_before_the_first_tick() -> None:
    """Not even the set point of index 0 is active before the first tick."""
    state = wavebot.KIND.start(params().rig)
    assert state.active_setpoint.setpoint == -1
    assert set(state.active_setpoint.law) == {0.0}


def test_the_wave_maker_runs_while_the_wave_clock_does() -> None:
    segments = plan(TARE, MOVING, (-1, Phase.LEAD_IN, 40, 0, 0), (0, Phase.MEASURE, 100, 0, 0))
    devices = ModifiedDevices(Quiet())
    result = run(
        KIND,
        params(segments)._replace(safety=QUICK),
        devices,
        clock=VirtualClock(DT),
        requests={140: safety.REQUEST_HOLD, 160: safety.REQUEST_RESUME, 180: safety.REQUEST_STOP},
    )
    assert result.error is None
    triggers_by_mode: dict[int, set[int]] = {}
    for row, command in zip(result.rows, devices.commands, strict=True):
        assert command.wave_trigger == int(row.plan.wave_clock >= 0.0)
        assert row.plan.wave_clock == -1.0 or row.plan.wave_clock >= 0.0
        triggers_by_mode.setdefault(row.safety.mode, set()).add(command.wave_trigger)
    first = next(row for row in result.rows if row.plan.wave_clock >= 0.0)
    assert (first.plan.phase, first.plan.wave_clock) == (Phase.LEAD_IN, 0.0)  # in the same tick
    assert (
        triggers_by_mode[OFF]
        == triggers_by_mode[ENABLING]
        == triggers_by_mode[STOP_1]
        == triggers_by_mode[STOP_0]
        == {0}
    )
    assert triggers_by_mode[STOP_2] == {1}
    assert 1 in triggers_by_mode[RUN]


def test_the_signals_of_a_wavebot_are_in_its_row() -> None:
    devices = ModifiedDevices(Quiet())
    result = run(KIND, params(PLANS["tared"])._replace(safety=QUICK), devices)
    for row, sense, command in zip(result.rows, devices.original, devices.commands, strict=True):
        assert (row.heave.sense, row.surge.sense, row.load, row.spring_sense) == sense[:4]
        other_signals = (row.power_sense, row.drive_sense, row.probes, row.wave, row.panel)
        assert other_signals == sense[4:]
        assert (row.heave.command, row.surge.command, row.spring_command) == command[:3]
        assert row.drive_command == command.drive
        assert isinstance(row.tare, tare.Zeros)
        assert isinstance(row.safety, safety.State)


# --- encoder jumps


@pytest.mark.parametrize("scale", [SCALE, -SCALE])
def test_counts_may_move_up_to_the_bound_between_two_ticks(scale: float) -> None:
    """The filter follows a part of the step at once; the bound applies to the remainder."""
    own = AXIS._replace(metres_per_count=scale)
    share = 1.0 - own.estimator.gain_position
    bound = own.limits.encoder_jump_stop / share / SCALE  # counts
    state = axis.start()
    at_rest = axis.observe(own, state, axis_sense(AT), 0.0, 1, DT)
    state, _ = axis.control(own, state, axis_sense(AT), at_rest, NONE, 1, 0, OFF, DT)
    own = own._replace(limits=own.limits._replace(velocity_stop=1e3, position_stop=10.0))
    for step, reason in (
        (int(bound) - 1, Reason.NONE),
        (1 - int(bound), Reason.NONE),
        (int(bound) + 2, Reason.ENCODER_JUMP),
        (-2 - int(bound), Reason.ENCODER_JUMP),
    ):
        sense = axis_sense(AT + step)
        motion = axis.observe(own, state, sense, 0.0, 1, DT)
        assert axis.check(own, state, sense, motion, 0.0, OFF) == reason
    fault = axis_sense(AT + 100_000)._replace(fault=1)
    motion = axis.observe(own, state, fault, 0.0, 1, DT)
    assert axis.check(own, state, fault, motion, 0.0, OFF) == Reason.DRIVE_FAULT
    tight = own._replace(limits=own.limits._replace(velocity_stop=1e-3))
    slipped = axis_sense(AT + 100_000)
    motion = axis.observe(tight, state, slipped, 0.0, 1, DT)
    assert axis.check(tight, state, slipped, motion, 0.0, OFF) == Reason.ENCODER_JUMP
