"""Faults of a simulated WaveBot: what each one does to the run, and in what order."""

from __future__ import annotations

import functools
from typing import Any

import pytest
from core_runs import LossyClock, Ran, run
from core_wavebot import CALM, SETPOINTS, SHORT, WAVES, Bend, Bent, configured, params, plant

from rig.kinds.wavebot import KIND, Command, Sense
from rig.realtime.safety import ENABLING, OFF, RUN, STOP_0, STOP_1, Reason
from rig.realtime.sequence import Phase

AT = 2000  # tick of a fault: measuring row 0


def rehearse(
    sense: Bend | None = None,
    command: Bend | None = None,
    sea: dict[str, Any] = WAVES,
    **more: Any,
) -> tuple[Ran, Bent]:
    devices = Bent(plant(sea), sense, command)
    made = run(KIND, more.pop("params", None) or params(), devices, **more)
    assert made.error is None
    assert made.end is not None
    assert len(devices.stops) == 5
    assert devices.closed == 1
    return made, devices


@functools.cache
def undisturbed() -> Ran:
    """A run without a fault."""
    return rehearse()[0]


def stop_of(made: Ran) -> Any:
    """The first row of the stop."""
    return next(row for row in made.rows if row.safety.mode >= STOP_1)


def reason(made: Ran) -> Reason:
    assert made.end is not None
    return Reason(made.end.reason)


def test_without_a_fault_the_plan_is_walked() -> None:
    made = undisturbed()
    assert reason(made) == Reason.PLAN_END
    modes = [row.safety.mode for row in made.rows]
    assert [m for i, m in enumerate(modes) if i == 0 or m != modes[i - 1]] == [
        OFF, ENABLING, RUN, STOP_1, STOP_0,
    ]  # fmt: skip
    measured = [row for row in made.rows if row.plan.phase == Phase.MEASURE]
    assert len(measured) == 2000
    assert min(row.heave.command.force for row in measured) < -50.0
    # damping takes power out of the waves, and the record says so with a minus
    assert sum(row.power.mechanical_1 for row in measured) < 0.0
    assert {row.heave.demand.kp for row in measured} == {-2000.0, -1000.0}


def test_a_stuck_encoder_disagrees_with_the_string_pot() -> None:
    stuck: list[int] = []

    def sense(tick: int, word: Sense) -> Sense:
        if tick < AT:
            return word
        stuck.append(stuck[0] if stuck else word.heave.counts)
        return word._replace(heave=word.heave._replace(counts=stuck[-1]))

    made, devices = rehearse(sense, sea=WAVES | {"amplitude_m": 0.15})
    assert reason(made) == Reason.POSITION_DISAGREES
    first = stop_of(made)
    assert first.safety.mode == STOP_0
    bound = configured()[2].heave.string_pot_difference_stop_m
    gap = first.load.string_pot - first.tare.string_pot - first.heave.estimate.position
    assert abs(gap) > bound
    scale = params().rig.heave.metres_per_count
    moved = abs(devices.true[first.tick].heave.counts - stuck[0]) * scale
    assert moved == pytest.approx(bound, abs=0.005)


@pytest.mark.parametrize(("age", "trips"), [(0.001, True), (0.08, False)])
def test_an_old_string_pot_may_be_where_the_body_was(age: float, trips: bool) -> None:
    """At 1.5 m/s at most, 0.08 s are worth 0.12 m: no gap of 0.1 m says that something slipped."""

    def sense(tick: int, word: Sense) -> Sense:
        load = word.load._replace(age=age)
        if tick >= AT:
            load = load._replace(string_pot=load.string_pot + 0.1)
        return word._replace(load=load)

    made, _ = rehearse(sense)
    assert (reason(made) == Reason.POSITION_DISAGREES) == trips


@pytest.mark.parametrize("jump", [-40_000, -4_000, -600, 600, 4_000, 40_000])
def test_a_jump_of_the_encoder_removes_power_at_once(jump: int) -> None:
    """From 15 mm to 1 m: there must be no damping against a velocity that is not there."""

    def sense(tick: int, word: Sense) -> Sense:
        more = jump if tick >= AT else 0
        return word._replace(heave=word.heave._replace(counts=word.heave.counts + more))

    made, _ = rehearse(sense)
    first = stop_of(made)
    assert (first.tick, first.safety.mode) == (AT, STOP_0)
    assert first.heave.command[:3] == (0.0, 0.0, 0)
    assert reason(made) == Reason.ENCODER_JUMP


def test_a_drive_that_drops_out_by_itself() -> None:
    def command(tick: int, word: Command) -> Command:
        off = word.heave._replace(enable=0) if tick == AT else word.heave
        return word._replace(heave=off)

    made, _ = rehearse(None, command)
    first = stop_of(made)
    assert reason(made) == Reason.DRIVE_DROPPED
    assert first.safety.mode == STOP_0
    assert first.heave.sense.enabled == 0
    assert AT < first.tick <= AT + 3
    assert first.heave.command[:3] == (0.0, 0.0, 0)


def test_a_drive_in_fault() -> None:
    def sense(tick: int, word: Sense) -> Sense:
        fault = int(tick >= AT)
        return word._replace(heave=word.heave._replace(fault=fault))

    made, _ = rehearse(sense)
    assert reason(made) == Reason.DRIVE_FAULT
    assert (stop_of(made).tick, stop_of(made).safety.mode) == (AT, STOP_0)


def test_a_drive_that_never_comes_up() -> None:
    def command(tick: int, word: Command) -> Command:
        return word._replace(heave=word.heave._replace(enable=0))

    timeout = 250
    base = params()
    patient = base._replace(safety=base.safety._replace(enable_ticks=timeout))
    made, _ = rehearse(None, command, params=patient)
    assert reason(made) == Reason.DRIVE_NOT_ON
    assert stop_of(made).safety.mode == STOP_0
    assert stop_of(made).tick == SHORT.ticks[0] + timeout
    assert all(row.heave.command.force == 0.0 for row in made.rows)


def test_a_stator_that_never_arrives_is_damped_then_released() -> None:
    """The drive is on by then, so the body is held by damping before power goes."""

    def command(tick: int, word: Command) -> Command:
        return word._replace(spring=word.spring._replace(enable=0))

    elsewhere = SETPOINTS._replace(spring_rate=(8340.0, 8340.0))
    base = params(setpoints=elsewhere)
    short = base._replace(safety=base.safety._replace(stop_ticks=600))
    made, _ = rehearse(None, command, params=short)
    assert reason(made) == Reason.STATOR_LATE
    modes = [row.safety.mode for row in made.rows]
    assert modes.count(STOP_1) == 600
    assert stop_of(made).safety.mode == STOP_1
    assert stop_of(made).tick == SHORT.ticks[0] + SHORT.timeout[1]
    damped = [row for row in made.rows if row.safety.mode == STOP_1]
    assert damped[-1].heave.demand[:2] == (-2500.0, 0.0)
    assert all(row.spring_command.enable == 0 for row in damped)
    assert all(row.heave.command.enable == 0 for row in made.rows if row.safety.mode == STOP_0)


def test_the_stator_stays_put_during_the_tare_and_in_a_stop() -> None:
    made, devices = rehearse(sea=CALM)
    for row, command in zip(made.rows, devices.commands, strict=True):
        moving = row.plan.phase != Phase.TARE and OFF < row.safety.mode <= RUN
        assert command.spring.enable == int(moving)


def test_a_tare_in_moving_water_is_refused() -> None:
    scale = params().rig.heave.metres_per_count

    def sense(tick: int, word: Sense) -> Sense:
        drift = 3 * tick  # counts a tick: 75 mm/s
        return word._replace(
            heave=word.heave._replace(counts=word.heave.counts + drift),
            load=word.load._replace(string_pot=word.load.string_pot + drift * scale),
        )

    made, _ = rehearse(sense, sea=CALM)
    assert reason(made) == Reason.NOT_CALM
    first = stop_of(made)
    assert first.plan.phase == Phase.TARE
    assert first.safety.mode == STOP_0  # the power was off and stays off
    assert not any(row.heave.command.enable for row in made.rows)


@pytest.mark.parametrize("bias", [-250.0, 400.0])
def test_a_bias_of_the_load_cell_is_tared_away(bias: float) -> None:
    def sense(tick: int, word: Sense) -> Sense:
        return word._replace(load=word.load._replace(lcb=word.load.lcb + bias))

    made, _ = rehearse(sense)
    plain = undisturbed()
    biased, last = made.rows[-1].tare, plain.rows[-1].tare
    assert last.samples == SHORT.ticks[0]
    assert biased.lcb - last.lcb == pytest.approx(bias, abs=1e-6)
    for row, other in zip(made.rows, plain.rows, strict=True):
        if row.plan.phase == Phase.MEASURE:
            assert row.power.mechanical_1 == pytest.approx(other.power.mechanical_1, abs=1e-6)
            assert row.heave.command == other.heave.command


def test_an_untared_encoder_gives_no_force() -> None:
    """Before the waves start, 4.6 m of encoder offset ask for nothing, whatever Ki is."""
    stiff = SETPOINTS._replace(ki=(5000.0, 5000.0))
    made, _ = rehearse(params=params(setpoints=stiff), sea=CALM)
    assert max(abs(row.heave.sense.counts) for row in made.rows) > 100_000
    assert reason(made) == Reason.PLAN_END
    assert max(abs(row.heave.command.force) for row in made.rows) < 10.0


def test_a_silent_analyser_is_a_controlled_stop() -> None:
    def sense(tick: int, word: Sense) -> Sense:
        return word._replace(power=word.power._replace(age=max(0.0, (tick - 1000) * 0.001)))

    made, _ = rehearse(sense)
    assert reason(made) == Reason.STALE_ANALYSER
    assert stop_of(made).safety.mode == STOP_1
    assert stop_of(made).tick == pytest.approx(2000, abs=1)


def test_lost_ticks_do_not_shift_the_plan_of_a_wavebot() -> None:
    """Losing 40 ms now and then: same windows, nearly the same motion."""
    gaps = dict.fromkeys(range(500, 4000, 400), 41)
    plain = undisturbed()
    made, _ = rehearse(clock=LossyClock(gaps))
    assert reason(made) == Reason.PLAN_END
    assert made.end is not None
    assert made.end.skipped == 40 * len(gaps)
    where = {row.tick: row.plan for row in plain.rows}
    position = {row.tick: row.heave.estimate.position for row in plain.rows}
    for row in made.rows:
        if row.safety.mode == RUN:
            assert row.plan == where[row.tick]
            assert row.heave.estimate.position == pytest.approx(position[row.tick], abs=0.01)
