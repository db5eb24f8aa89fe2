"""The bench's part of the cycle: its loops, its brake, its tare, and every stop by its name."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import pytest
from core_bench import PULL, QUICK, Quiet, params, plant, setpoints
from core_runs import Ran, run
from core_wavebot import Bent

from rig.kinds.oswec_bench import KIND, Sense
from rig.kinds.oswec_bench.signals import BenchRow
from rig.realtime import cycle
from rig.realtime.limits import Limited
from rig.realtime.safety import CATEGORY, RUN, STOP_0, STOP_1, Reason
from rig.realtime.sequence import Phase
from rig.recording.row_layout import leaves

AT = 700  # in MEASURE


def ran(sense: Any = None, made: cycle.Params | None = None, inner: Any = None) -> tuple[Ran, Bent]:
    made = made or params()
    if inner is None:  # its shaft stands still: a servo that ignores its commands
        limits = made.rig.limits._replace(velocity_difference_stop=math.inf)
        made = made._replace(rig=made.rig._replace(limits=limits))
    devices = Bent(inner or Quiet(), sense)
    done = run(KIND, made, devices)
    assert done.error is None
    return done, devices


def bent(part: str, at: int = AT, **values: Any) -> Any:
    """One word of the sense replaced from tick ``at`` on."""

    def spoil(tick: int, word: Sense) -> Sense:
        if tick < at:
            return word
        return word._replace(**{part: getattr(word, part)._replace(**values)})

    return spoil


# Far beyond the slip: both encoders jump in one tick, so each by itself; the shaft creeps.
FAULTS: list[tuple[str, dict[str, Any], Reason]] = [
    ("panel", {"e_stop": 1}, Reason.EMERGENCY_STOP),
    ("panel", {"limit_switch": 1}, Reason.LIMIT_SWITCH),
    ("panel", {"age": 1.5}, Reason.STALE_PANEL),
    ("encoders", {"age": 0.5}, Reason.STALE_ENCODER),
    ("encoders", {"age": -0.5}, Reason.STALE_ENCODER),
    ("encoders", {"motor_counts": 60_000}, Reason.ENCODER_JUMP),
    ("encoders", {"shaft_counts": 1_000}, Reason.SHAFT_ENCODER_JUMP),
    ("servo", {"age": 0.5}, Reason.STALE_DRIVE),
    ("servo", {"fault": 7}, Reason.DRIVE_FAULT),
    ("servo", {"enabled": 0}, Reason.DRIVE_DROPPED),
    ("load", {"tz": 121.0}, Reason.LOAD_CELL_OVERLOAD),
    ("load", {"tz": -121.0}, Reason.LOAD_CELL_OVERLOAD),
    ("load", {"fx": 2801.0}, Reason.LOAD_CELL_OVERLOAD),
    ("load", {"fy": -2801.0}, Reason.LOAD_CELL_OVERLOAD),
    ("load", {"fz": 6801.0}, Reason.LOAD_CELL_OVERLOAD),
    ("load", {"tx": -121.0}, Reason.LOAD_CELL_OVERLOAD),
    ("load", {"ty": 121.0}, Reason.LOAD_CELL_OVERLOAD),
    ("load", {"age": 0.5}, Reason.STALE_LOAD_CELL),
    ("brake", {"age": 0.5}, Reason.STALE_BRAKE),
]


@pytest.mark.parametrize(("part", "values", "reason"), FAULTS)
def test_every_fault_stops_by_its_name_in_its_tick(
    part: str, values: dict[str, Any], reason: Reason
) -> None:
    done, devices = ran(bent(part, **values))
    row = done.rows[AT]
    assert done.rows[AT - 1].safety.mode == RUN
    assert row.safety.reason == reason
    assert row.safety.mode == (STOP_0 if CATEGORY[reason] == 0 else STOP_1)
    assert done.end is not None
    assert done.end.reason == reason
    if CATEGORY[reason] == 0:
        told = devices.commands[AT]
        assert (told.enable, told.volts, told.current, told.brake_current) == (0, 0.0, 0.0, 0.0)


NUMBERS = [leaf for leaf in leaves(BenchRow) if leaf.path[0] in Sense._fields and leaf.code == "d"]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf], ids=str)
@pytest.mark.parametrize("leaf", NUMBERS, ids=lambda leaf: leaf.name)
def test_no_number_in_any_sensor_is_a_stop_and_never_a_command(leaf: Any, bad: float) -> None:
    part, field = leaf.path
    done, devices = ran(bent(part, **{field: bad}))
    row = done.rows[AT]
    assert row.safety.mode == STOP_0
    assert row.safety.reason in (Reason.NOT_FINITE, Reason.STALE_ENCODER, Reason.STALE_DRIVE)
    for told in devices.commands[AT:]:
        assert (told.enable, told.volts, told.current, told.brake_current) == (0, 0.0, 0.0, 0.0)


def test_a_brake_that_does_not_obey_is_lost_after_a_while() -> None:
    """Current that is not what it was told to be: not at once, and named as what it is."""
    made = params(setpoints=setpoints(params().rig.setpoints.components[0][0], 0.0, 0.5))
    ticks = made.rig.limits.brake_ticks_stop
    done, devices = ran(bent("brake", current=0.0), made)
    assert devices.commands[AT - 1].brake_current == 0.5
    stopped = next(row for row in done.rows if row.safety.mode != RUN and row.tick > AT)
    assert stopped.safety.reason == Reason.BRAKE_LOST
    assert stopped.safety.mode == STOP_1
    assert stopped.tick == AT + ticks


def test_motor_and_shaft_that_part_slowly_have_slipped() -> None:
    """A count at a time: no encoder jumps, and yet they are apart at last."""

    def creeping(tick: int, word: Sense) -> Sense:
        turned = max(0, tick - 300) * 12  # counts of 524288 a turn: 8.2 deg/s
        words = word.encoders
        return word._replace(encoders=words._replace(shaft_counts=words.shaft_counts + turned))

    done, _ = ran(creeping)
    assert done.end is not None
    assert done.end.reason == Reason.COUPLING_SLIP
    last = next(row for row in done.rows if row.safety.reason)
    assert math.degrees(abs(last.motor.angle - last.shaft.angle)) == pytest.approx(1.5, abs=0.02)


def test_a_shaft_that_turns_in_the_tare_is_not_calm() -> None:
    def turning(tick: int, word: Sense) -> Sense:
        words = word.encoders._replace(
            motor_counts=31415 + 11 * tick * 15 // 8, shaft_counts=-2718 + 11 * tick
        )
        return word._replace(encoders=words)

    done, _ = ran(turning)
    assert done.end is not None
    assert done.end.reason == Reason.NOT_CALM


def test_the_tare_takes_the_zeros() -> None:
    done, _ = ran()
    first, last = done.rows[0], done.rows[-1]
    assert first.tared.samples == 0
    assert last.tared.samples == 60
    assert last.tared.motor == pytest.approx(31415 * params().rig.motor.metres_per_count)
    assert last.tared.torque == pytest.approx(0.12)
    assert last.motor.angle == pytest.approx(0.0, abs=1e-9)


def test_a_velocity_row_turns_the_simulated_shaft() -> None:
    done, _ = ran(inner=plant())
    assert done.end is not None
    assert done.end.reason == Reason.PLAN_END
    measured = [row for row in done.rows if row.plan.phase == Phase.MEASURE]
    assert [row.plan.row for row in measured] == [0] * 400
    assert measured[0].reference.angle == pytest.approx(math.radians(5.0), rel=1e-9)
    high = max(row.shaft.angle for row in measured)
    # The drive's gain is 2.3 % low, and gap and twist of the driveline take 0.1 deg of 5.
    assert high == pytest.approx(math.radians(5.0), rel=0.07)
    # The brake takes R |v|, as its map says, against either direction.
    row = max(measured, key=lambda one: abs(one.shaft.velocity))
    assert row.command.brake_torque == pytest.approx(60.0 * abs(row.shaft.velocity), rel=0.02)
    assert all(one.command.brake_current >= 0.0 for one in done.rows)
    push = [one.load.tz * one.shaft.velocity for one in measured]
    assert sum(push) > 0.0  # the motor's torque on the brake, along the motion


def test_a_torque_row_pulls_at_the_clamped_shaft() -> None:
    done, _ = ran(made=params(PULL, name="torque_constant"), inner=plant())
    assert done.end is not None
    assert done.end.reason == Reason.PLAN_END
    measured = [row for row in done.rows if row.plan.phase == Phase.MEASURE]
    high = max(measured, key=lambda row: row.command.current)
    assert high.reference.torque == pytest.approx(20.0, rel=1e-3)
    assert high.command.current == pytest.approx(20.0 / 16.845, rel=1e-3)
    assert high.load.tz - high.tared.torque == pytest.approx(20.0, rel=0.2)
    assert all(row.command.volts == 0.0 and row.command.locked == 1 for row in measured)


@pytest.mark.parametrize(
    ("component", "name"), [(None, "driveline_short"), (PULL, "torque_constant")]
)
def test_a_controlled_stop_brings_the_shaft_to_rest(component: Any, name: str) -> None:
    made = params(component, name=name, locked=0) if component else params(name=name)
    done, _ = ran(bent("panel", limit_switch=1), made, plant())
    stop = [row for row in done.rows if row.safety.mode == STOP_1]
    assert len(stop) == QUICK.stop_ticks
    assert stop[0].tick == AT
    assert abs(stop[-1].shaft.velocity) < 0.3 * max(abs(stop[0].shaft.velocity), 0.1)
    after = [row for row in done.rows if row.safety.mode == STOP_0]
    assert all((row.command.enable, row.command.brake_current) == (0, 0.0) for row in after)


def test_what_is_asked_too_much_is_not_granted_and_says_so() -> None:
    fast = params()._replace(safety=QUICK)
    most = fast.rig.speed._replace(most=0.2, acceleration=5.0)
    done, _ = ran(made=fast._replace(rig=fast.rig._replace(speed=most)))
    row = [one for one in done.rows if one.plan.phase == Phase.MEASURE]
    assert max(abs(one.command.velocity) for one in row) <= 0.2
    flags = {one.command.limited for one in row}
    assert any(flag & Limited.VELOCITY for flag in flags)
    assert any(flag & Limited.SLEW for flag in flags)
    speeds = [one.command.velocity for one in row]
    changes = [abs(after - before) for before, after in pairwise(speeds)]
    assert max(changes) <= 5.0 * 0.001 + 1e-12
