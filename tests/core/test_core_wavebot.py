"""A WaveBot's second axis, its custom drive and its references, in still water."""

from __future__ import annotations

import math
from typing import Any

import pytest
from core_runs import RunResult, plan, run
from core_wavebot import READY, ModifiedDevices, Quiet, params, table

from controllers.signals import DriveFault
from rig.kinds.wavebot.tick import KIND, Sense
from rig.kinds.wavebot.tick.reasons import WaveBotReason
from rig.kinds.wavebot.tick.state import SurgeUse
from rig.realtime import cycle, safety
from rig.realtime.limits import LimitFlag
from rig.realtime.reasons import Reason
from rig.realtime.safety import RUN, STOP_0, STOP_1
from rig.realtime.sequence import Phase

pytestmark = pytest.mark.usefixtures("execution")

AT = 120
PLAN = plan(
    (-1, Phase.TARE, 20, 0, 0),
    (-1, Phase.MOVING, 20, READY, 0),
    (0, Phase.SETTLE, 40, 0, 0),
    (0, Phase.MEASURE, 200, 0, 0),
)
QUICK = safety.Params(enable_ticks=50, stop_ticks=30)
SURGE_COUNT = 2.52e-5  # m, about one count


def run_quiet(
    sense: Any = None, result: cycle.Params | None = None
) -> tuple[RunResult, ModifiedDevices]:
    devices = ModifiedDevices(Quiet(), sense)
    own = (result or params(PLAN))._replace(safety=QUICK)
    done = run(KIND, own, devices)
    assert done.error is None
    return done, devices


def modified(part: str, **values: Any) -> Any:
    """Return a modifier that replaces one part of the sense from tick AT on."""

    def corrupt(tick: int, signals: Sense) -> Sense:
        if tick < AT:
            return signals
        return signals._replace(**{part: getattr(signals, part)._replace(**values)})

    return corrupt


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"encoder_age": 0.5}, WaveBotReason.SURGE_STALE_ENCODER),
        ({"drive_age": 0.5}, WaveBotReason.SURGE_STALE_DRIVE),
        ({"fault": 1}, WaveBotReason.SURGE_DRIVE_FAULT),
        ({"fault": DriveFault.UNDERVOLTAGE.value}, WaveBotReason.SURGE_DRIVE_FAULT),
        ({"fault": DriveFault.FIELDBUS_LOST.value, "drive_age": 0.5}, Reason.FIELDBUS_LOST),
        ({"enabled": 0}, WaveBotReason.SURGE_DRIVE_DROPPED),
        ({"counts": 40_000}, WaveBotReason.SURGE_ENCODER_JUMP),
    ],
)
def test_a_surge_fault_has_a_surge_reason(values: dict[str, Any], reason: Reason) -> None:
    result, devices = run_quiet(modified("surge", **values))
    first = result.rows[AT]
    assert (first.safety.mode, first.safety.reason) == (STOP_0, reason)
    assert KIND.reason_table.categories[reason] == 0
    assert devices.commands[AT].surge[:3] == devices.commands[AT].heave[:3] == (0.0, 0.0, 0)


@pytest.mark.parametrize(
    ("values", "mode", "reason"),
    [
        ({"e_stop": 1}, STOP_0, Reason.EMERGENCY_STOP),
        ({"limit_switch": 1}, STOP_1, Reason.LIMIT_SWITCH),
        ({"age": 1.5}, STOP_1, Reason.STALE_PANEL),
        ({"age": math.nan}, STOP_0, Reason.NOT_FINITE),
        ({"e_stop": 1, "limit_switch": 1, "age": math.nan}, STOP_0, Reason.EMERGENCY_STOP),
    ],
)
def test_the_panel_inputs_stop_the_rig(values: dict[str, Any], mode: int, reason: Reason) -> None:
    result, _ = run_quiet(modified("panel", **values))
    assert (result.rows[AT].safety.mode, result.rows[AT].safety.reason) == (mode, reason)
    assert result.rows[AT].panel == result.rows[0].panel._replace(**values) or "age" in values


def drifting(counts: int) -> Any:
    """Return a modifier that moves surge by ``counts`` a tick."""

    def corrupt(tick: int, signals: Sense) -> Sense:
        more = counts * max(0, tick - 60)
        return signals._replace(surge=signals.surge._replace(counts=signals.surge.counts + more))

    return corrupt


@pytest.mark.parametrize(
    ("bounds", "counts", "reason"),
    [
        ({"position_stop": 0.05}, 20, WaveBotReason.SURGE_POSITION),
        ({"velocity_stop": 0.3}, 20, WaveBotReason.SURGE_VELOCITY),
    ],
)
def test_a_limit_of_surge_is_a_controlled_stop(
    bounds: dict[str, float], counts: int, reason: Reason
) -> None:
    base = params(PLAN)
    surge = base.rig.surge._replace(limits=base.rig.surge.limits._replace(**bounds))
    result, _ = run_quiet(drifting(counts), base._replace(rig=base.rig._replace(surge=surge)))
    first = next(row for row in result.rows if row.safety.reason)
    assert (first.safety.mode, first.safety.reason) == (STOP_1, reason)


def test_station_keeping_pushes_against_the_velocity_of_surge() -> None:
    result, _ = run_quiet(drifting(4))  # 0.1 m/s
    row = next(row for row in result.rows if row.plan.phase == Phase.MEASURE and row.tick > 230)
    assert row.surge.estimate.velocity == pytest.approx(4 * SURGE_COUNT / 0.001, rel=0.01)
    share = row.surge.demand.kp / -2500.0
    assert 0.0 < share < 1.0  # the gain is still being ramped
    assert row.surge.demand.force == pytest.approx(
        row.surge.demand.kp * row.surge.estimate.velocity
    )
    assert row.surge.command.force < 0.0
    assert row.heave.command.force == 0.0


def test_an_unused_surge_drive_stays_off() -> None:
    base = params(PLAN)
    off = base._replace(rig=base.rig._replace(surge_use=int(SurgeUse.OFF)))
    result, devices = run_quiet(drifting(4), off)
    assert result.end is not None
    assert result.end.reason == Reason.PLAN_END
    assert {row.surge.sense.enabled for row in result.rows} == {0}
    assert {command.surge[:3] for command in devices.commands} == {(0.0, 0.0, 0)}
    # Its encoder is still checked.
    result, _ = run_quiet(modified("surge", encoder_age=0.5), off)
    assert result.end is not None
    assert result.end.reason == WaveBotReason.SURGE_STALE_ENCODER


def test_surge_can_be_held_in_place() -> None:
    base = params(PLAN)
    rig = base.rig._replace(
        surge_use=int(SurgeUse.HOLD), surge_hold=base.rig.surge_hold._replace(ramp=0.01)
    )
    result, _ = run_quiet(drifting(4), base._replace(rig=rig))
    row = result.rows[230]
    hold = base.rig.surge_hold
    pulled = -hold.stiffness * row.surge.estimate.position
    assert row.surge.demand.force == pytest.approx(
        pulled - hold.damping * row.surge.estimate.velocity, rel=0.05
    )


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (DriveFault.GENERAL, Reason.DRIVE_FAULT),
        (DriveFault.UNDERVOLTAGE, WaveBotReason.BUS_UNDERVOLTAGE),
        (DriveFault.OVERVOLTAGE, WaveBotReason.BUS_OVERVOLTAGE),
        (DriveFault.FIELDBUS_LOST, Reason.FIELDBUS_LOST),
    ],
)
def test_bus_faults_have_their_own_reasons(fault: DriveFault, reason: Reason) -> None:
    result, _ = run_quiet(modified("heave", fault=fault.value))
    assert (result.rows[AT].safety.mode, result.rows[AT].safety.reason) == (STOP_0, reason)


def test_too_much_on_the_bus_removes_power() -> None:
    bound = params().rig.limits.bus_voltage_stop
    result, _ = run_quiet(modified("power", bus_voltage=bound))
    assert result.end is not None
    assert result.end.reason == Reason.PLAN_END
    result, _ = run_quiet(modified("power", bus_voltage=bound + 0.1))
    assert (result.rows[AT].safety.mode, result.rows[AT].safety.reason) == (
        STOP_0,
        WaveBotReason.BUS_OVERVOLTAGE,
    )


def rising(counts: int) -> Any:
    """Return a modifier that moves heave and the string pot up by ``counts`` a tick."""
    scale = params().rig.heave.metres_per_count

    def corrupt(tick: int, signals: Sense) -> Sense:
        more = counts * max(0, tick - 60)
        return signals._replace(
            heave=signals.heave._replace(counts=signals.heave.counts + more),
            load=signals.load._replace(string_pot=signals.load.string_pot + more * scale),
        )

    return corrupt


def test_the_stroke_of_the_set_point_is_a_controlled_stop() -> None:
    result, _ = run_quiet(rising(8), params(PLAN))
    assert result.end is not None
    assert result.end.reason == Reason.PLAN_END
    quick_stop = table((-2000.0,), (0.0,), (490.9,))._replace(stroke=(0.02,))
    result, _ = run_quiet(rising(8), params(PLAN, quick_stop))
    first = next(row for row in result.rows if row.safety.reason)
    assert (first.safety.mode, first.safety.reason) == (STOP_1, WaveBotReason.SPRING_STROKE)
    assert first.heave.estimate.position > 0.02
    assert result.rows[first.tick - 1].heave.estimate.position <= 0.02


def test_below_its_thresholds_the_power_stage_rests() -> None:
    slow = table((-2000.0,), (0.0,), (490.9,))._replace(velocity_threshold=(0.05,))
    base = params(PLAN, slow)
    gated = base._replace(
        rig=base.rig._replace(
            gate=base.rig.gate._replace(current=3.0),
            heave_law=base.rig.heave_law._replace(ramp=0.001),
        )
    )

    result, devices = run_quiet(rising(1), gated)  # 25 mm/s
    resting = [row for row in result.rows if row.safety.mode == RUN]
    assert {row.drive_command.conducting for row in resting} == {0}
    assert {row.heave.command for row in resting} == {(0.0, 0.0, 1, LimitFlag.GATED)}
    assert any(row.heave.demand.force != 0.0 for row in resting)
    result, devices = run_quiet(rising(4), gated)  # 100 mm/s: above the threshold after the start
    late = [row for row in result.rows if row.safety.mode == RUN and row.tick > 200]
    assert {row.drive_command.conducting for row in late} == {1}
    assert all(row.heave.command.force < 0.0 for row in late)
    # In a stop it brakes, whatever the thresholds.
    stopping = [row for row in result.rows if row.safety.mode == STOP_1]
    assert {row.drive_command.conducting for row in stopping} == {1}
    assert {command.drive.settings.velocity_threshold for command in devices.commands} == {0.05}


def test_the_reference_is_added_from_its_own_clock_and_at_the_scale_of_the_row() -> None:
    wave = tuple(float(100 + i) for i in range(7))
    points = table((0.0, 0.0), (0.0, 0.0), (490.9, 490.9))._replace(reference_scale=(1.0, 0.5))
    segments = plan(
        (-1, Phase.TARE, 20, 0, 0),
        (-1, Phase.MOVING, 20, READY, 0),
        (0, Phase.MEASURE, 40, 0, 0),
        (1, Phase.MEASURE, 40, 0, 1),
    )
    base = params(segments, points)
    rig = base.rig._replace(reference=base.rig.reference._replace(table=wave, ramp=0.0))
    limits = rig.heave.limits._replace(force_slew=1e9)
    rig = rig._replace(heave=rig.heave._replace(limits=limits, stop_ramp=0.0))
    result, _ = run_quiet(None, base._replace(rig=rig))
    values = 0
    for row in result.rows:
        at = round(row.plan.wave_clock / 0.001)
        if row.safety.mode != RUN or row.plan.wave_clock < 0.0:
            assert row.reference.force == 0.0
            continue
        scale = (1.0, 0.5)[row.plan.row]
        assert row.reference == (scale, scale * wave[at % 7])
        assert row.heave.demand.force == pytest.approx(row.reference.force)
        assert row.heave.command.force == pytest.approx(row.reference.force)
        values += 1
    assert values == 80
