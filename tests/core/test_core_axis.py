"""From counts to motion: sign, seed and zero of one axis, and what a WaveBot makes of a tare."""

from __future__ import annotations

from typing import Any

import core_wavebot
import pytest
from core_kinds import AXIS, DT, SCALE
from core_runs import LossyClock, Ran, plan, run
from core_wavebot import READY, Bent, Quiet, params
from hypothesis import given
from hypothesis import strategies as st

from controllers import estimator
from controllers.signals import AxisSense, Demand, Estimate
from rig.kinds import wavebot
from rig.kinds.wavebot import KIND, Sense, tare
from rig.realtime import axis, cycle, safety
from rig.realtime.clock import VirtualClock
from rig.realtime.limits import Warned
from rig.realtime.safety import ENABLING, OFF, RUN, STOP_0, STOP_1, STOP_2, Reason
from rig.realtime.sequence import Phase

NONE = axis.NOTHING
AT = 183264  # counts
COUNTS = st.integers(-(2**40), 2**40)
ZERO = st.floats(-10.0, 10.0)
SCALES = st.sampled_from([SCALE, -SCALE, 2.52e-5, -2.52e-5])


def sensed(counts: int) -> AxisSense:
    return AxisSense(counts, 0.0, 0.0, 1, 0, 0.0)


def followed(
    own: axis.Params, counts: list[int], zero: float = 0.0, mode: int = RUN
) -> list[axis.Record]:
    """What an axis records of these counts, one a tick."""
    state, out = axis.start(), []
    for count in counts:
        sense = sensed(count)
        motion = axis.observe(own, state, sense, zero, 1, DT)
        state, record = axis.control(own, state, sense, motion, NONE, 1, 0, mode, DT)
        out.append(record)
    return out


# --- the seed


@given(COUNTS, ZERO, SCALES, st.integers(1, 1000))
def test_the_first_count_is_taken_as_it_is(
    counts: int, zero: float, scale: float, periods: int
) -> None:
    """Whatever it is, nothing moves yet: a filter that crept there would show a velocity."""
    own = AXIS._replace(metres_per_count=scale)
    motion = axis.observe(own, axis.start(), sensed(counts), zero, periods, DT)
    assert motion == (counts * scale - zero, 0.0, 0.0)
    assert type(motion) is Estimate


@pytest.mark.parametrize("mode", [OFF, ENABLING, RUN, STOP_2, STOP_1, STOP_0])
def test_an_axis_that_stands_where_it_was_found_stays_there(mode: int) -> None:
    records = followed(AXIS, [AT] * 100, mode=mode)
    assert {record.estimate for record in records} == {(AT * SCALE, 0.0, 0.0)}
    records = followed(AXIS, [AT] * 100, zero=AT * SCALE, mode=mode)
    assert {record.estimate for record in records} == {(0.0, 0.0, 0.0)}


@pytest.mark.parametrize("mode", [OFF, ENABLING, RUN, STOP_2, STOP_1, STOP_0])
def test_only_the_first_count_is_the_seed(mode: int) -> None:
    """In every mode the next one is filtered: it is not taken at its word again."""
    first, second = followed(AXIS, [AT, AT + 1000], mode=mode)
    expected = estimator.step(AXIS.estimator, first.estimate, (AT + 1000) * SCALE, 1, DT)
    assert second.estimate == expected
    assert second.estimate.velocity > 0.0
    assert AT * SCALE < second.estimate.position < (AT + 1000) * SCALE


def test_a_count_of_zero_is_a_seed_too() -> None:
    _, second = followed(AXIS, [0, 1000])
    assert second.estimate == estimator.step(
        AXIS.estimator, Estimate(0.0, 0.0, 0.0), 1000 * SCALE, 1, DT
    )


def test_the_switch_on_state_has_seen_nothing() -> None:
    state = axis.start()
    assert (state.motion, state.acting) == ((0.0, 0.0, 0.0), axis.UNSEEN)


# --- the sign of the counts


def test_counts_that_grow_downwards_give_a_negative_velocity() -> None:
    counts = [AT + round(0.2 * k * DT / SCALE) for k in range(3000)]
    down = AXIS._replace(metres_per_count=-SCALE)
    up, fallen = followed(AXIS, counts), followed(down, counts)
    mirrored = followed(down, [-count for count in counts])
    assert up[-1].estimate.velocity == pytest.approx(0.2, rel=0.01)
    for one, other, same in zip(up, fallen, mirrored, strict=True):
        assert tuple(other.estimate) == tuple(-x for x in one.estimate)
        assert same.estimate == one.estimate


def test_lost_periods_are_predicted() -> None:
    before = axis.start()._replace(motion=Estimate(0.5, -0.2, 0.3), acting=RUN)
    sense = sensed(round(0.5 / SCALE) - 900)
    for periods in (1, 2, 50):
        motion = axis.observe(AXIS, before, sense, 0.1, periods, DT)
        measured = sense.counts * SCALE - 0.1
        assert motion == estimator.step(AXIS.estimator, before.motion, measured, periods, DT)


# --- another zero


@given(st.lists(st.integers(-60, 60), min_size=2, max_size=60), ZERO, ZERO, st.data())
def test_another_zero_shifts_the_position_and_nothing_else(
    steps: list[int], zero: float, by: float, data: Any
) -> None:
    """An axis whose zero moves goes on like one that has had the new zero from the start."""
    at = data.draw(st.integers(1, len(steps)))
    moved = one = axis.start()
    counts, here = AT, zero
    for k, more in enumerate([*steps, 0]):
        if k == at:
            moved, here = axis.rezero(moved, by), zero + by
        counts += more
        sense = sensed(counts)
        shifted = axis.observe(AXIS, moved, sense, here, 1, DT)
        plain = axis.observe(AXIS, one, sense, zero, 1, DT)
        assert shifted.position == pytest.approx(plain.position - (here - zero), abs=1e-11)
        assert shifted.velocity == pytest.approx(plain.velocity, abs=1e-9)
        assert shifted.acceleration == pytest.approx(plain.acceleration, abs=1e-7)
        moved, _ = axis.control(AXIS, moved, sense, shifted, NONE, 1, 0, RUN, DT)
        one, _ = axis.control(AXIS, one, sense, plain, NONE, 1, 0, RUN, DT)


def test_another_zero_leaves_all_other_memory() -> None:
    state, sense = axis.start(), sensed(AT)
    for mode in (RUN, RUN, STOP_2):
        motion = Estimate(0.02, 0.1, -0.3)
        wanted = Demand(-500.0, 900.0, 0.0, -32.0)
        state, _ = axis.control(AXIS, state, sense, motion, wanted, 1, 0, mode, DT)
    assert state.limits.force != 0.0
    assert state.acting == STOP_1
    assert 0.0 < state.fade < 1.0
    after = axis.rezero(state, 0.005)
    assert after == state._replace(motion=Estimate(0.02 - 0.005, 0.1, -0.3))
    assert after.limits is state.limits
    assert type(after) is axis.State
    assert axis.rezero(axis.start(), 4.6).acting == axis.UNSEEN  # the first count is still to come


# --- what is recorded


def test_the_record_holds_what_came_in_and_what_went_out() -> None:
    sense, motion = sensed(AT), Estimate(0.01, 0.1, 0.2)
    running = axis.start()._replace(acting=RUN)
    wanted = Demand(-500.0, 0.0, 3.0, -49.4)
    state, record = axis.control(AXIS, running, sense, motion, wanted, 1, 0, RUN, DT)
    assert record.sense is sense
    assert record.estimate is motion is state.motion
    assert record.demand is wanted
    assert record.command.force == wanted.force == state.limits.force
    assert record.command.enable == 1
    assert record.warned == 0


@pytest.mark.parametrize("mode", [OFF, ENABLING, RUN, STOP_2, STOP_1, STOP_0])
@pytest.mark.parametrize(
    ("position", "flag"), [(0.2, 0), (-0.2, 0), (0.2001, 1), (-0.2001, 1), (0.0, 0)]
)
def test_a_far_position_is_warned_of_in_every_mode(mode: int, position: float, flag: int) -> None:
    assert AXIS.limits.position_warn == 0.2
    motion = Estimate(position, 0.0, 0.0)
    _, record = axis.control(AXIS, axis.start(), sensed(0), motion, NONE, 1, 0, mode, DT)
    assert record.warned == flag == (Warned.POSITION if flag else 0)
    assert type(record.warned) is int


# --- the tare of a WaveBot whose body creeps, as it does in any basin

TARE = (-1, Phase.TARE, 50, 0, 0)
MOVING = (-1, Phase.MOVING, 20, READY, 0)
PLANS = {
    "tared": plan(TARE, MOVING, (0, Phase.SETTLE, 150, 0, 0)),
    "tared twice": plan(TARE, MOVING, (-1, Phase.TARE, 40, 0, 0), (0, Phase.SETTLE, 110, 0, 0)),
    "not tared": plan(MOVING, (0, Phase.SETTLE, 200, 0, 0)),
}
CREEP = 1  # count a tick: 25 mm/s, 1.3 mm in a tare
QUICK = safety.Params(enable_ticks=50, stop_ticks=5)


def crept(name: str, scale: float, gaps: dict[int, int]) -> Ran:
    """A run of a rig whose body creeps, and its string pot with it."""
    base = params(PLANS[name])._replace(safety=QUICK)
    heave = base.rig.heave._replace(metres_per_count=scale)
    own = base._replace(rig=base.rig._replace(heave=heave))

    def creep(tick: int, word: Sense) -> Sense:
        by = CREEP * tick
        return word._replace(
            heave=word.heave._replace(counts=word.heave.counts + by),
            load=word.load._replace(string_pot=word.load.string_pot + by * scale),
        )

    made = run(KIND, own, Bent(Quiet(), creep), clock=LossyClock(gaps))
    assert made.error is None
    assert made.end is not None
    assert made.end.reason == Reason.PLAN_END
    return made


@pytest.mark.parametrize("gaps", [{}, {50: 3}, {51: 3}, {40: 4, 52: 5}], ids=str)
@pytest.mark.parametrize("down", [1.0, -1.0])
@pytest.mark.parametrize("name", PLANS)
def test_the_end_of_a_tare_moves_the_zero_and_nothing_else(
    name: str, down: float, gaps: dict[int, int]
) -> None:
    """Every tick against a filter in the encoder's own frame, which knows of no zero at all."""
    shipped = params().rig.heave
    scale = down * shipped.metres_per_count
    rows = crept(name, scale, gaps).rows
    true = Estimate(rows[0].heave.sense.counts * scale, 0.0, 0.0)
    zero, last = true.position, 0  # at first where the body is found
    zeros = set()
    for i, row in enumerate(rows):
        if i:
            measured = row.heave.sense.counts * scale
            true = estimator.step(shipped.estimator, true, measured, row.tick - last, DT)
        x, v, a = row.heave.estimate
        assert x == pytest.approx(true.position - zero, abs=1e-11)
        assert v == pytest.approx(true.velocity, abs=1e-9)
        assert a == pytest.approx(true.acceleration, abs=1e-7)
        zero, last = row.tare.position, row.tick  # what a row says holds from the next one on
        zeros.add(zero)
    assert len(zeros) == {"tared": 2, "tared twice": 3, "not tared": 1}[name]
    assert abs(true.velocity - CREEP * scale / DT) < 1e-4


@pytest.mark.parametrize("down", [1.0, -1.0])
@pytest.mark.parametrize("name", PLANS)
def test_the_zeros_are_means_of_what_was_sensed(name: str, down: float) -> None:
    scale = down * params().rig.heave.metres_per_count
    rows = crept(name, scale, {}).rows
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


def test_at_the_end_of_a_tare_the_position_is_that_from_its_middle() -> None:
    """By hand: the body creeps 1 count a tick and is tared for 50 ticks, so their mean is 24.5."""
    scale = params().rig.heave.metres_per_count
    rows = crept("tared", scale, {}).rows
    assert rows[50].plan.phase == Phase.MOVING
    before, after = rows[50].heave.estimate, rows[51].heave.estimate
    assert before.position / scale == pytest.approx(50.0, abs=1.0)
    assert after.position / scale == pytest.approx(51.0 - 24.5, abs=1.0)
    assert after.velocity == pytest.approx(before.velocity, rel=0.02)


def test_the_first_tick_of_a_wavebot_is_its_zero_wherever_it_is_found() -> None:
    for counts in (-500_000, 0, AT):
        quiet = Quiet().read(0.0)
        sense = quiet._replace(heave=quiet.heave._replace(counts=counts))
        motion = wavebot.observe(params().rig, wavebot.start(params().rig), sense, 1, DT)
        assert motion == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


# --- what the plan says reaches a WaveBot


def test_each_set_point_brings_its_own_gains_and_spring_rate_there_and_back() -> None:
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
    state, sense = wavebot.start(own), Quiet().read(0.0)
    place, guard = cycle.PlanRecord(0, Phase.SETTLE, 0, -1.0), safety.State(RUN, 0, 0)
    for setpoint in (0, 0, 1, 1, 2, 0, 2, 1, 0, 0):
        motion = wavebot.observe(own, state, sense, 1, DT)
        state, command, words = wavebot.control(
            own, state, sense, motion, place, guard, setpoint, DT
        )
        heave, surge, *_ = words
        kp, ki, _, _ = heave.demand
        assert (kp, ki) == pytest.approx((table.kp[setpoint], table.ki[setpoint]))
        kp, ki, _, _ = surge.demand
        assert (kp, ki) == pytest.approx((table.surge_kp[setpoint], table.surge_ki[setpoint]))
        assert command.spring.rate == table.spring_rate[setpoint]
        assert command.drive.settings.bus_voltage == table.bus_voltage[setpoint]
        assert command.drive.settings.discharge_level == table.discharge_level[setpoint]
        assert state.active_setpoint.setpoint == setpoint
        assert state.active_setpoint.stroke == table.stroke[setpoint]


def test_a_start_with_the_first_set_point_uses_it_at_once() -> None:
    """No set point is in use before the first tick, not even that of index 0."""
    state = wavebot.start(params().rig)
    assert state.active_setpoint.setpoint == -1
    assert set(state.active_setpoint.gains) == {0.0}


def test_the_wave_maker_runs_while_the_wave_clock_does() -> None:
    segments = plan(TARE, MOVING, (-1, Phase.LEAD_IN, 40, 0, 0), (0, Phase.MEASURE, 100, 0, 0))
    devices = Bent(Quiet())
    made = run(
        KIND,
        params(segments)._replace(safety=QUICK),
        devices,
        clock=VirtualClock(DT),
        posts={140: safety.REQUEST_HOLD, 160: safety.REQUEST_RESUME, 180: safety.REQUEST_STOP},
    )
    assert made.error is None
    told: dict[int, set[int]] = {}
    for row, command in zip(made.rows, devices.commands, strict=True):
        assert command.wave_trigger == int(row.plan.wave_clock >= 0.0)
        assert row.plan.wave_clock == -1.0 or row.plan.wave_clock >= 0.0
        told.setdefault(row.safety.mode, set()).add(command.wave_trigger)
    first = next(row for row in made.rows if row.plan.wave_clock >= 0.0)
    assert (first.plan.phase, first.plan.wave_clock) == (Phase.LEAD_IN, 0.0)  # in the very tick
    assert told[OFF] == told[ENABLING] == told[STOP_1] == told[STOP_0] == {0}
    assert told[STOP_2] == {1}
    assert 1 in told[RUN]


def test_the_words_of_a_wavebot_are_in_its_row() -> None:
    devices = Bent(Quiet())
    made = run(KIND, params(PLANS["tared"])._replace(safety=QUICK), devices)
    for row, sense, command in zip(made.rows, devices.true, devices.commands, strict=True):
        assert (row.heave.sense, row.surge.sense, row.load, row.spring_sense) == sense[:4]
        seen = (row.power_sense, row.drive_sense, row.probes, row.wave, row.panel)
        assert seen == sense[4:]
        assert (row.heave.command, row.surge.command, row.spring_command) == command[:3]
        assert row.drive_command == command.drive
        assert isinstance(row.tare, tare.Zeros)
        assert isinstance(row.safety, safety.State)


# --- the jump


@pytest.mark.parametrize("scale", [SCALE, -SCALE])
def test_counts_may_move_up_to_the_bound_between_two_ticks(scale: float) -> None:
    """The filter takes a part of the step at once; the bound is on what it leaves."""
    own = AXIS._replace(metres_per_count=scale)
    share = 1.0 - own.estimator.gain_position
    bound = own.limits.encoder_jump_stop / share / SCALE  # counts
    state = axis.start()
    at_rest = axis.observe(own, state, sensed(AT), 0.0, 1, DT)
    state, _ = axis.control(own, state, sensed(AT), at_rest, NONE, 1, 0, OFF, DT)
    own = own._replace(limits=own.limits._replace(velocity_stop=1e3, position_stop=10.0))
    for step, reason in (
        (int(bound) - 1, Reason.NONE),
        (1 - int(bound), Reason.NONE),
        (int(bound) + 2, Reason.ENCODER_JUMP),
        (-2 - int(bound), Reason.ENCODER_JUMP),
    ):
        sense = sensed(AT + step)
        motion = axis.observe(own, state, sense, 0.0, 1, DT)
        assert axis.check(own, state, sense, motion, 0.0, OFF) == reason
    fault = sensed(AT + 100_000)._replace(fault=1)
    motion = axis.observe(own, state, fault, 0.0, 1, DT)
    assert axis.check(own, state, fault, motion, 0.0, OFF) == Reason.DRIVE_FAULT
    tight = own._replace(limits=own.limits._replace(velocity_stop=1e-3))
    slipped = sensed(AT + 100_000)
    motion = axis.observe(tight, state, slipped, 0.0, 1, DT)
    assert axis.check(tight, state, slipped, motion, 0.0, OFF) == Reason.ENCODER_JUMP
