"""Faults of a simulated WaveBot: the reaction of the run to each of them.

Faults act between loop and plant, so the compiled tick is that of a real rig, without its plant:
ticks coupled with a plant read no signals that a test could change.
"""

from __future__ import annotations

import functools
from typing import Any

import pytest
from core_runs import LossyClock, RunResult, run
from core_wavebot import (
    CALM,
    SETPOINTS,
    SHORT,
    WAVES,
    ModifiedDevices,
    Modifier,
    params,
    plant,
    shipped_files,
)

from rig.kinds.wavebot.tick import KIND, Command, Sense
from rig.kinds.wavebot.tick.reasons import WaveBotReason
from rig.realtime.reasons import Reason
from rig.realtime.safety import ENABLING, OFF, RUN, STOP_0, STOP_1
from rig.realtime.sequence import Phase

pytestmark = [pytest.mark.usefixtures("execution"), pytest.mark.sampled]

AT = 2000  # tick of a fault: measuring row 0


def rehearse(
    sense: Modifier | None = None,
    command: Modifier | None = None,
    sea: dict[str, Any] = WAVES,
    **more: Any,
) -> tuple[RunResult, ModifiedDevices]:
    devices = ModifiedDevices(plant(sea), sense, command)
    result = run(KIND, more.pop("params", None) or params(), devices, **more)
    assert result.error is None
    assert result.end is not None
    assert len(devices.stops) == 5
    assert devices.closed == 1
    return result, devices


@functools.cache
def undisturbed(execution: str) -> RunResult:
    """Return a run without a fault; ``execution``: that of the calling test."""
    return rehearse()[0]


def stop_of(result: RunResult) -> Any:
    """Return the first row of the stop."""
    return next(row for row in result.rows if row.safety.mode >= STOP_1)


def reason(result: RunResult) -> int:
    assert result.end is not None
    return result.end.reason


def test_without_a_fault_the_plan_runs_to_its_end(execution: str) -> None:
    result = undisturbed(execution)
    assert reason(result) == Reason.PLAN_END
    modes = [row.safety.mode for row in result.rows]
    assert [m for i, m in enumerate(modes) if i == 0 or m != modes[i - 1]] == [
        OFF, ENABLING, RUN, STOP_1, STOP_0,
    ]  # fmt: skip
    measured = [row for row in result.rows if row.plan.phase == Phase.MEASURE]
    assert len(measured) == 2000
    assert min(row.heave.command.force for row in measured) < -50.0
    # damping absorbs power from the waves, which the record shows as negative
    assert sum(row.power.mechanical_1 for row in measured) < 0.0
    assert {row.heave.demand.kp for row in measured} == {-2000.0, -1000.0}


def test_a_stuck_encoder_disagrees_with_the_string_pot() -> None:
    stuck: list[int] = []

    def sense(tick: int, signals: Sense) -> Sense:
        if tick < AT:
            return signals
        stuck.append(stuck[0] if stuck else signals.heave.counts)
        return signals._replace(heave=signals.heave._replace(counts=stuck[-1]))

    result, devices = rehearse(sense, sea=WAVES | {"amplitude_m": 0.15})
    assert reason(result) == WaveBotReason.POSITION_DISAGREES
    first = stop_of(result)
    assert first.safety.mode == STOP_0
    bound = shipped_files()[2].heave.string_pot_difference_stop_m
    gap = first.load.string_pot - first.tare.string_pot - first.heave.estimate.position
    assert abs(gap) > bound
    scale = params().rig.heave.metres_per_count
    moved = abs(devices.original[first.tick].heave.counts - stuck[0]) * scale
    assert moved == pytest.approx(bound, abs=0.005)


@pytest.mark.parametrize(("age", "trips"), [(0.001, True), (0.08, False)])
def test_an_old_string_pot_value_is_given_more_tolerance(age: float, trips: bool) -> None:
    """At up to 1.5 m/s, 0.08 s correspond to 0.12 m: a difference of 0.1 m proves no slip."""

    def sense(tick: int, signals: Sense) -> Sense:
        load = signals.load._replace(age=age)
        if tick >= AT:
            load = load._replace(string_pot=load.string_pot + 0.1)
        return signals._replace(load=load)

    result, _ = rehearse(sense)
    assert (reason(result) == WaveBotReason.POSITION_DISAGREES) == trips


@pytest.mark.parametrize("jump", [-40_000, -4_000, -600, 600, 4_000, 40_000])
def test_a_jump_of_the_encoder_removes_power_at_once(jump: int) -> None:
    """Jumps of 15 mm to 1 m: there must be no damping of a velocity that does not exist."""

    def sense(tick: int, signals: Sense) -> Sense:
        more = jump if tick >= AT else 0
        return signals._replace(heave=signals.heave._replace(counts=signals.heave.counts + more))

    result, _ = rehearse(sense)
    first = stop_of(result)
    assert (first.tick, first.safety.mode) == (AT, STOP_0)
    assert first.heave.command[:3] == (0.0, 0.0, 0)
    assert reason(result) == Reason.ENCODER_JUMP


def test_a_drive_that_disables_itself_trips() -> None:
    def command(tick: int, signals: Command) -> Command:
        off = signals.heave._replace(enable=0) if tick == AT else signals.heave
        return signals._replace(heave=off)

    result, _ = rehearse(None, command)
    first = stop_of(result)
    assert reason(result) == Reason.DRIVE_DROPPED
    assert first.safety.mode == STOP_0
    assert first.heave.sense.enabled == 0
    assert AT < first.tick <= AT + 3
    assert first.heave.command[:3] == (0.0, 0.0, 0)


def test_a_drive_fault_trips() -> None:
    def sense(tick: int, signals: Sense) -> Sense:
        fault = int(tick >= AT)
        return signals._replace(heave=signals.heave._replace(fault=fault))

    result, _ = rehearse(sense)
    assert reason(result) == Reason.DRIVE_FAULT
    assert (stop_of(result).tick, stop_of(result).safety.mode) == (AT, STOP_0)


def test_a_drive_that_never_enables_trips() -> None:
    def command(tick: int, signals: Command) -> Command:
        return signals._replace(heave=signals.heave._replace(enable=0))

    timeout = 250
    base = params()
    with_timeout = base._replace(safety=base.safety._replace(enable_ticks=timeout))
    result, _ = rehearse(None, command, params=with_timeout)
    assert reason(result) == Reason.DRIVE_NOT_ON
    assert stop_of(result).safety.mode == STOP_0
    assert stop_of(result).tick == SHORT.ticks[0] + timeout
    assert all(row.heave.command.force == 0.0 for row in result.rows)


def test_a_stator_that_never_arrives_is_damped_then_released() -> None:
    """The drive is on by then, so damping stops the body before power is removed."""

    def command(tick: int, signals: Command) -> Command:
        return signals._replace(spring=signals.spring._replace(enable=0))

    elsewhere = SETPOINTS._replace(spring_rate=(8340.0, 8340.0))
    base = params(setpoints=elsewhere)
    quick_stop = base._replace(safety=base.safety._replace(stop_ticks=600))
    result, _ = rehearse(None, command, params=quick_stop)
    assert reason(result) == WaveBotReason.STATOR_LATE
    modes = [row.safety.mode for row in result.rows]
    assert modes.count(STOP_1) == 600
    assert stop_of(result).safety.mode == STOP_1
    assert stop_of(result).tick == SHORT.ticks[0] + SHORT.timeout[1]
    damped = [row for row in result.rows if row.safety.mode == STOP_1]
    assert damped[-1].heave.demand[:2] == (-2500.0, 0.0)
    assert all(row.spring_command.enable == 0 for row in damped)
    assert all(row.heave.command.enable == 0 for row in result.rows if row.safety.mode == STOP_0)


def test_the_stator_stays_put_during_the_tare_and_in_a_stop() -> None:
    result, devices = rehearse(sea=CALM)
    for row, command in zip(result.rows, devices.commands, strict=True):
        moving = row.plan.phase != Phase.TARE and OFF < row.safety.mode <= RUN
        assert command.spring.enable == int(moving)


def test_a_tare_in_moving_water_is_refused() -> None:
    scale = params().rig.heave.metres_per_count

    def sense(tick: int, signals: Sense) -> Sense:
        drift = 3 * tick  # counts a tick: 75 mm/s
        return signals._replace(
            heave=signals.heave._replace(counts=signals.heave.counts + drift),
            load=signals.load._replace(string_pot=signals.load.string_pot + drift * scale),
        )

    result, _ = rehearse(sense, sea=CALM)
    assert reason(result) == Reason.NOT_CALM
    first = stop_of(result)
    assert first.plan.phase == Phase.TARE
    assert first.safety.mode == STOP_0  # power was off and stays off
    assert not any(row.heave.command.enable for row in result.rows)


@pytest.mark.parametrize("bias", [-250.0, 400.0])
def test_the_tare_removes_a_bias_of_the_load_cell(bias: float, execution: str) -> None:
    def sense(tick: int, signals: Sense) -> Sense:
        return signals._replace(load=signals.load._replace(lcb=signals.load.lcb + bias))

    result, _ = rehearse(sense)
    plain = undisturbed(execution)
    biased, last = result.rows[-1].tare, plain.rows[-1].tare
    assert last.samples == SHORT.ticks[0]
    assert biased.lcb - last.lcb == pytest.approx(bias, abs=1e-6)
    for row, other in zip(result.rows, plain.rows, strict=True):
        if row.plan.phase == Phase.MEASURE:
            assert row.power.mechanical_1 == pytest.approx(other.power.mechanical_1, abs=1e-6)
            assert row.heave.command == other.heave.command


def test_an_untared_encoder_gives_no_force() -> None:
    """Before the waves start, 4.6 m of encoder offset cause no force, whatever Ki is."""
    law_columns = (SETPOINTS.law[0], (5000.0, 5000.0), *SETPOINTS.law[2:])
    stiff = SETPOINTS._replace(law=law_columns)
    result, _ = rehearse(params=params(setpoints=stiff), sea=CALM)
    assert max(abs(row.heave.sense.counts) for row in result.rows) > 100_000
    assert reason(result) == Reason.PLAN_END
    assert max(abs(row.heave.command.force) for row in result.rows) < 10.0


def test_a_silent_analyser_is_a_controlled_stop() -> None:
    def sense(tick: int, signals: Sense) -> Sense:
        return signals._replace(power=signals.power._replace(age=max(0.0, (tick - 1000) * 0.001)))

    result, _ = rehearse(sense)
    assert reason(result) == WaveBotReason.STALE_ANALYSER
    assert stop_of(result).safety.mode == STOP_1
    assert stop_of(result).tick == pytest.approx(2000, abs=1)


def test_lost_ticks_do_not_shift_the_plan_of_a_wavebot(execution: str) -> None:
    """With 40 ms lost repeatedly the windows are the same and the motion nearly so."""
    gaps = dict.fromkeys(range(500, 4000, 400), 41)
    plain = undisturbed(execution)
    result, _ = rehearse(clock=LossyClock(gaps))
    assert reason(result) == Reason.PLAN_END
    assert result.end is not None
    assert result.end.skipped == 40 * len(gaps)
    where = {row.tick: row.plan for row in plain.rows}
    position = {row.tick: row.heave.estimate.position for row in plain.rows}
    for row in result.rows:
        if row.safety.mode == RUN:
            assert row.plan == where[row.tick]
            assert row.heave.estimate.position == pytest.approx(position[row.tick], abs=0.01)
