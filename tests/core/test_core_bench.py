"""The bench's part of the cycle: its loops, its brake, its tare, and the reason of every stop."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest
from core_bench import (
    QUICK_SAFETY,
    SHORT_PLAN,
    SHORT_ROW,
    TORQUE_REFERENCE,
    VELOCITY_REFERENCE,
    Quiet,
    params,
    setpoints,
    simulated_bench,
)
from core_runs import RunResult, run
from core_wavebot import ModifiedDevices

from controllers.oswec_position import Components
from rig.kinds.oswec_bench.sessions.plan import NO_COMPONENTS, REST, setpoint_table
from rig.kinds.oswec_bench.tick import Sense
from rig.kinds.oswec_bench.tick.cycle import KIND
from rig.kinds.oswec_bench.tick.reasons import BenchReason
from rig.kinds.oswec_bench.tick.signals import BenchRow
from rig.realtime import cycle
from rig.realtime.limits import LimitFlag
from rig.realtime.reasons import Reason
from rig.realtime.safety import RUN, STOP_0, STOP_1
from rig.realtime.sequence import Phase
from rig.recording.row_layout import leaves

pytestmark = pytest.mark.usefixtures("execution")

FAULT_TICK = 700  # a tick of MEASURE


def run_bench(
    sense: Any = None, parameters: cycle.Params | None = None, simulated: Any = None
) -> tuple[RunResult, ModifiedDevices]:
    parameters = parameters or params()
    if simulated is None:  # its shaft stands still, like a servo that ignores its commands
        limits = parameters.rig.limits._replace(velocity_difference_stop=math.inf)
        parameters = parameters._replace(rig=parameters.rig._replace(limits=limits))
    devices = ModifiedDevices(simulated or Quiet(), sense)
    result = run(KIND, parameters, devices)
    assert result.error is None
    return result, devices


def altered_sense(part: str, from_tick: int = FAULT_TICK, **values: Any) -> Any:
    """Replace values of one part of the sense from tick ``from_tick`` on."""

    def alter(tick: int, reading: Sense) -> Sense:
        if tick < from_tick:
            return reading
        return reading._replace(**{part: getattr(reading, part)._replace(**values)})

    return alter


# Each encoder jumps alone, far beyond the slip limit; a creeping shaft has its own test.
FAULTS: list[tuple[str, dict[str, Any], Reason]] = [
    ("panel", {"e_stop": 1}, Reason.EMERGENCY_STOP),
    ("panel", {"limit_switch": 1}, Reason.LIMIT_SWITCH),
    ("panel", {"age": 1.5}, Reason.STALE_PANEL),
    ("encoders", {"age": 0.5}, Reason.STALE_ENCODER),
    ("encoders", {"age": -0.5}, Reason.STALE_ENCODER),
    ("encoders", {"motor_counts": 60_000}, Reason.ENCODER_JUMP),
    ("encoders", {"shaft_counts": 1_000}, BenchReason.SHAFT_ENCODER_JUMP),
    ("servo", {"age": 0.5}, Reason.STALE_DRIVE),
    ("servo", {"fault": 7}, Reason.DRIVE_FAULT),
    ("servo", {"fault": -1}, Reason.DRIVE_FAULT),  # a drive has negative numbers of errors, too
    ("servo", {"enabled": 0}, Reason.DRIVE_DROPPED),
    ("load", {"tz": 121.0}, BenchReason.LOAD_CELL_OVERLOAD),
    ("load", {"tz": -121.0}, BenchReason.LOAD_CELL_OVERLOAD),
    ("load", {"fx": 2801.0}, BenchReason.LOAD_CELL_OVERLOAD),
    ("load", {"fy": -2801.0}, BenchReason.LOAD_CELL_OVERLOAD),
    ("load", {"fz": 6801.0}, BenchReason.LOAD_CELL_OVERLOAD),
    ("load", {"tx": -121.0}, BenchReason.LOAD_CELL_OVERLOAD),
    ("load", {"ty": 121.0}, BenchReason.LOAD_CELL_OVERLOAD),
    ("load", {"age": 0.5}, BenchReason.STALE_LOAD_CELL),
    ("brake", {"age": 0.5}, BenchReason.STALE_BRAKE),
]


@pytest.mark.parametrize(("part", "values", "reason"), FAULTS)
def test_every_fault_trips_in_its_tick_with_its_reason(
    part: str, values: dict[str, Any], reason: Reason
) -> None:
    result, devices = run_bench(altered_sense(part, **values))
    row = result.rows[FAULT_TICK]
    assert result.rows[FAULT_TICK - 1].safety.mode == RUN
    assert row.safety.reason == reason
    assert row.safety.mode == (STOP_0 if KIND.reason_table.categories[reason] == 0 else STOP_1)
    assert result.end is not None
    assert result.end.reason == reason
    if KIND.reason_table.categories[reason] == 0:
        command = devices.commands[FAULT_TICK]
        assert (command.enable, command.volts, command.current, command.brake_current) == (
            0,
            0.0,
            0.0,
            0.0,
        )


NUMBERS = [leaf for leaf in leaves(BenchRow) if leaf.path[0] in Sense._fields and leaf.code == "d"]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf], ids=str)
@pytest.mark.parametrize("leaf", NUMBERS, ids=lambda leaf: leaf.name)
def test_a_non_finite_sensor_value_trips_and_never_reaches_a_command(leaf: Any, bad: float) -> None:
    part, field = leaf.path
    result, devices = run_bench(altered_sense(part, **{field: bad}))
    row = result.rows[FAULT_TICK]
    assert row.safety.mode == STOP_0
    assert row.safety.reason in (Reason.NOT_FINITE, Reason.STALE_ENCODER, Reason.STALE_DRIVE)
    for command in devices.commands[FAULT_TICK:]:
        assert (command.enable, command.volts, command.current, command.brake_current) == (
            0,
            0.0,
            0.0,
            0.0,
        )


def test_a_brake_without_its_commanded_current_trips_after_the_time_limit() -> None:
    """A wrong current trips after the permitted number of ticks, with its own reason."""
    parameters = params(setpoints=setpoints(damping=0.0, brake_current=0.5))
    ticks = parameters.rig.limits.brake_ticks_stop
    result, devices = run_bench(altered_sense("brake", current=0.0), parameters)
    assert devices.commands[FAULT_TICK - 1].brake_current == 0.5
    stopped = next(row for row in result.rows if row.safety.mode != RUN and row.tick > FAULT_TICK)
    assert stopped.safety.reason == BenchReason.BRAKE_LOST
    assert stopped.safety.mode == STOP_1
    assert stopped.tick == FAULT_TICK + ticks


def test_a_slow_divergence_of_motor_and_shaft_trips_as_coupling_slip() -> None:
    """The shaft creeps count by count: no encoder jumps, and the slip grows to its limit."""

    def creeping(tick: int, sense: Sense) -> Sense:
        extra_counts = max(0, tick - 300) * 12  # counts of 524288 a turn: 8.2 deg/s
        encoders = sense.encoders
        return sense._replace(
            encoders=encoders._replace(shaft_counts=encoders.shaft_counts + extra_counts)
        )

    result, _ = run_bench(creeping)
    assert result.end is not None
    assert result.end.reason == BenchReason.COUPLING_SLIP
    last = next(row for row in result.rows if row.safety.reason)
    assert math.degrees(abs(last.motor.angle - last.shaft.angle)) == pytest.approx(1.5, abs=0.02)


def test_a_shaft_that_turns_during_the_tare_trips() -> None:
    def turning(tick: int, sense: Sense) -> Sense:
        encoders = sense.encoders._replace(
            motor_counts=31415 + 11 * tick * 15 // 8, shaft_counts=-2718 + 11 * tick
        )
        return sense._replace(encoders=encoders)

    result, _ = run_bench(turning)
    assert result.end is not None
    assert result.end.reason == Reason.NOT_CALM


def test_the_tare_sets_the_zeros() -> None:
    result, _ = run_bench()
    first, last = result.rows[0], result.rows[-1]
    assert first.tared.samples == 0
    assert last.tared.samples == 60
    assert last.tared.motor == pytest.approx(31415 * params().rig.motor.metres_per_count)
    assert last.tared.torque == pytest.approx(0.12)
    assert last.motor.angle == pytest.approx(0.0, abs=1e-9)


def test_a_velocity_row_turns_the_simulated_shaft() -> None:
    result, _ = run_bench(simulated=simulated_bench())
    assert result.end is not None
    assert result.end.reason == Reason.PLAN_END
    measured = [row for row in result.rows if row.plan.phase == Phase.MEASURE]
    assert [row.plan.row for row in measured] == [0] * 400
    assert measured[0].reference.angle == pytest.approx(math.radians(5.0), rel=1e-9)
    high = max(row.shaft.angle for row in measured)
    # The drive's gain is 2.3 % low, and gap and twist of the driveline take 0.1 deg of 5.
    assert high == pytest.approx(math.radians(5.0), rel=0.07)
    # The brake's torque is R |v| by its map, in both directions.
    row = max(measured, key=lambda one: abs(one.shaft.velocity))
    assert row.command.brake_torque == pytest.approx(60.0 * abs(row.shaft.velocity), rel=0.02)
    assert all(one.command.brake_current >= 0.0 for one in result.rows)
    push = [one.load.tz * one.shaft.velocity for one in measured]
    assert sum(push) > 0.0  # the motor's torque on the brake, along the motion


def test_the_row_has_the_power_at_load_cell_and_motor() -> None:
    parameters = params()
    result, _ = run_bench(parameters=parameters, simulated=simulated_bench())
    constant = parameters.rig.motor.limits.newtons_per_ampere
    measured = [row for row in result.rows if row.plan.phase == Phase.MEASURE]
    powers = [
        (
            (row.load.tz - row.tared.torque) * row.shaft.velocity,
            constant * row.servo.current * row.motor.velocity,
        )
        for row in measured
    ]
    assert [row.power[:2] for row in measured] == powers
    means = tuple(math.fsum(power) / len(powers) for power in zip(*powers, strict=True))
    assert measured[-1].power[2:] == (*map(pytest.approx, means), len(powers))
    assert means[1] > means[0] > 1.0  # W: the motor drives the brake through the gearbox's friction


def test_a_torque_row_loads_the_clamped_shaft() -> None:
    result, _ = run_bench(
        parameters=params(TORQUE_REFERENCE, name="torque_constant"), simulated=simulated_bench()
    )
    assert result.end is not None
    assert result.end.reason == Reason.PLAN_END
    measured = [row for row in result.rows if row.plan.phase == Phase.MEASURE]
    high = max(measured, key=lambda row: row.command.current)
    assert high.reference.torque == pytest.approx(20.0, rel=1e-3)
    assert high.command.current == pytest.approx(20.0 / 16.845, rel=1e-3)
    assert high.load.tz - high.tared.torque == pytest.approx(20.0, rel=0.2)
    assert all(row.command.volts == 0.0 and row.command.locked == 1 for row in measured)


@pytest.mark.parametrize(
    ("components", "name"), [(None, "driveline_short"), (TORQUE_REFERENCE, "torque_constant")]
)
def test_a_controlled_stop_brings_the_shaft_to_rest(components: Any, name: str) -> None:
    parameters = params(components, name=name, locked=0) if components else params(name=name)
    result, _ = run_bench(altered_sense("panel", limit_switch=1), parameters, simulated_bench())
    stop = [row for row in result.rows if row.safety.mode == STOP_1]
    assert len(stop) == QUICK_SAFETY.stop_ticks
    assert stop[0].tick == FAULT_TICK
    assert abs(stop[-1].shaft.velocity) < 0.3 * max(abs(stop[0].shaft.velocity), 0.1)
    after = [row for row in result.rows if row.safety.mode == STOP_0]
    assert all((row.command.enable, row.command.brake_current) == (0, 0.0) for row in after)


def test_a_row_moves_by_the_components_of_its_own_set_point() -> None:
    """The table has the components of all set points one after another; the first has none."""
    two = Components((0.06, 0.02), (12.0, 31.0), (0.3, -1.0), (1.0, 1.0), (0.0, 0.0))
    components = (NO_COMPONENTS, VELOCITY_REFERENCE, two)
    table = setpoint_table(
        tuple(REST._replace(components=each, span=SHORT_ROW) for each in components)
    )
    assert (table.first, table.length) == ((0, 0, 1), (0, 1, 2))
    for index, own in enumerate(components):
        segments = SHORT_PLAN._replace(setpoint=(index,) * len(SHORT_PLAN.row))
        result, _ = run_bench(parameters=params(segments=segments, setpoints=table))
        moving = [row for row in result.rows if 0.1 <= row.plan.wave_clock <= 0.8]
        assert len(moving) > 600
        for row in moving:
            expected = sum(
                amplitude * math.cos(omega * row.plan.wave_clock + phase)
                for amplitude, omega, phase, _, _ in zip(*own, strict=True)
            )
            assert row.reference.angle == pytest.approx(expected, abs=1e-15)


def test_a_demand_beyond_the_limits_is_clipped_and_flagged() -> None:
    base = params()._replace(safety=QUICK_SAFETY)
    tight_limits = base.rig.speed._replace(max_velocity=0.2, acceleration=5.0)
    result, _ = run_bench(parameters=base._replace(rig=base.rig._replace(speed=tight_limits)))
    row = [one for one in result.rows if one.plan.phase == Phase.MEASURE]
    assert max(abs(one.command.velocity) for one in row) <= 0.2
    flags = {one.command.limited for one in row}
    assert any(flag & LimitFlag.VELOCITY for flag in flags)
    assert any(flag & LimitFlag.SLEW for flag in flags)
    speeds = [one.command.velocity for one in row]
    changes = [abs(after - before) for before, after in pairwise(speeds)]
    assert max(changes) <= 5.0 * 0.001 + 1e-12
