"""The WaveBot as a kind of rig: heave and surge axes, magnetic spring, load cells, power."""

from math import floor

from controllers import (
    drive_gating,
    impedance,
    magnetic_spring,
    open_loop,
    position_hold,
    station_keeping,
)
from controllers.signals import Demand, DriveCommand, Reference
from rig.kinds.wavebot import stations, tare
from rig.kinds.wavebot.check import check
from rig.kinds.wavebot.signals import Command, Motion, Sense, TickSignals, WaveBotRow
from rig.kinds.wavebot.state import (
    REFERENCE_SURGE,
    SURGE_HELD,
    SURGE_KEPT,
    SURGE_OFF,
    ActiveSetpoint,
    Laws,
    Params,
    State,
    hold,
    laws_at_rest,
    start,
    zeros,
)
from rig.realtime import axis, cycle, power, safety
from rig.realtime.safety import OFF, RUN
from rig.realtime.sequence import TARE, WAIT_DRIVE, WAIT_STATOR


def observe(params: Params, state: State, sense: Sense, periods: int, dt: float) -> Motion:
    """Motion of both axes relative to the zeros in use."""
    heave, surge, _, _, _, _, _, _, _ = sense
    heave_zero, surge_zero = zeros(params, state, heave, surge)
    return (
        axis.observe(params.heave, state.heave, heave, heave_zero, periods, dt),
        axis.observe(params.surge, state.surge, surge, surge_zero, periods, dt),
    )


def ready(params: Params, state: State, sense: Sense) -> int:
    """Which conditions of the plan hold."""
    flags = 0
    if magnetic_spring.arrived(params.spring, state.spring, sense.spring):
        flags = flags | WAIT_STATOR
    if sense.heave.enabled == 1 and (params.surge_use == SURGE_OFF or sense.surge.enabled == 1):
        flags = flags | WAIT_DRIVE
    return flags


def control(
    params: Params,
    state: State,
    sense: Sense,
    motion: Motion,
    plan: cycle.PlanRecord,
    guard: safety.State,
    setpoint: int,
    dt: float,
) -> tuple[State, Command, TickSignals]:
    """Set point -> forces within limits, stator target, drive settings, wave trigger; and power."""
    heave, laws, surge, spring, tared, spent, powers, held = state
    heave_sense, surge_sense, load, _, meter, drive_sense, _, _, _ = sense
    in_heave, in_surge = motion
    _, phase, _, wave_clock = plan
    mode = guard.mode
    if setpoint != held.setpoint:
        held = hold(params, setpoint)
    if mode == RUN:
        laws, wanted, reference, conducting, aside = _laws(
            params, laws, motion, held, heave.saturation_deficit, wave_clock, dt
        )
    else:  # at rest they start afresh, so a later start ramps its gains up from zero
        laws = laws_at_rest(params)
        wanted, reference, conducting, aside = axis.NO_DEMAND, _NO_REFERENCE, 1, axis.NO_DEMAND
    drive = held.drive if conducting == 1 else DriveCommand(0, held.drive.settings)
    saturated = drive_sense.saturated
    heave, record = axis.control(
        params.heave, heave, heave_sense, in_heave, wanted, conducting, saturated, mode, dt
    )
    surge_mode = OFF if params.surge_use == SURGE_OFF else mode
    surge, surge_record = axis.control(
        params.surge, surge, surge_sense, in_surge, aside, 1, 0, surge_mode, dt
    )
    # The stator stays put in a stop, and is not moved before the tare is over or while all is off.
    move = 1 if phase != TARE and OFF < mode <= RUN else 0
    spring = magnetic_spring.step(params.spring, spring, held.spring_rate, move)
    if phase == TARE or tared.samples > 0 or tared.seeded == 0:
        before, tared = tared, tare.step(tared, _raw(params, sense), phase)
        if before.seeded == 1:
            heave = axis.rezero(heave, tared.zeros.position - before.zeros.position)
            surge = axis.rezero(surge, tared.zeros.surge - before.zeros.surge)
    zero = tared.zeros
    ac, dc, _, _ = meter
    lcb, trs = load.lcb - zero.lcb, load.trs - zero.trs
    spent = power.step(spent, lcb, trs, in_heave.velocity, ac, dc, phase)
    powers = stations.step(
        params.stations, powers, record, heave.fade_share, saturated, lcb, trs, ac, mode
    )
    waves = 1 if wave_clock >= 0.0 else 0
    return (
        State(heave, laws, surge, spring, tared, spent, powers, held),
        Command(record.command, surge_record.command, spring.command, drive, waves),
        (record, surge_record, reference, spent, zero),
    )


_NO_REFERENCE = Reference(0.0, 0.0)


def _laws(
    params: Params,
    laws: Laws,
    motion: Motion,
    held: ActiveSetpoint,
    short: float,
    wave_clock: float,
    dt: float,
) -> tuple[Laws, Demand, Reference, int, Demand]:
    """Demand of heave, the reference, whether heave's power stage is in use, demand of surge."""
    law, table, gate, keeping, holding = laws
    in_heave, in_surge = motion
    reference = _NO_REFERENCE
    if len(params.reference.table) > 0:
        at = floor(wave_clock / dt + 0.5) if wave_clock >= 0.0 else -1
        table, force = open_loop.step(
            params.reference, table, held.reference_scale, held.realisation, at, dt
        )
        reference = Reference(table.scale.value, force)
    along = reference.force if params.reference_axis != REFERENCE_SURGE else 0.0
    across = reference.force - along
    law, wanted = impedance.step(params.heave_law, law, held.gains, in_heave, along, short, dt)
    conducting, threshold = 1, held.drive.settings.velocity_threshold
    if threshold > 0.0:
        current = wanted.force / params.heave.limits.newtons_per_ampere
        gate, conducting = drive_gating.step(
            params.gate, gate, in_heave.velocity, current, threshold
        )
    aside, use = axis.NO_DEMAND, params.surge_use
    if use == SURGE_KEPT:
        keeping, aside = station_keeping.step(
            params.station_keeping, keeping, held.surge, in_surge, dt
        )
    elif use == SURGE_HELD:
        holding, aside = position_hold.step(params.surge_hold, holding, 0.0, in_surge, dt)
    if across != 0.0 and use != SURGE_OFF:
        kp, ki, km, force = aside
        aside = Demand(kp, ki, km, force + across)
    return (law, table, gate, keeping, holding), wanted, reference, conducting, aside


def _raw(params: Params, sense: Sense) -> tare.Raw:
    """What is tared, as it is sensed in this tick."""
    load = sense.load
    return tare.Raw(
        sense.heave.counts * params.heave.metres_per_count,
        sense.surge.counts * params.surge.metres_per_count,
        load.string_pot,
        load.lcb,
        load.trs,
        load.slew,
        load.stator_a,
        load.stator_b,
    )


def row(
    tick: int,
    time: float,
    timing: cycle.Timing,
    plan: cycle.PlanRecord,
    guard: safety.State,
    sense: Sense,
    command: Command,
    signals: TickSignals,
) -> WaveBotRow:
    """The tick's log row."""
    heave, surge, reference, spent, zero = signals
    _, _, load, spring_sense, meter, drive_sense, probes, wave, panel = sense
    _, _, spring, drive, _ = command
    return WaveBotRow(
        tick,
        time,
        timing,
        plan,
        guard,
        heave,
        surge,
        reference,
        load,
        spring_sense,
        spring,
        drive_sense,
        drive,
        meter,
        spent,
        zero,
        probes,
        wave,
        panel,
        tick,
    )


KIND = cycle.Kind(WaveBotRow, Params, start, observe, ready, check, control, row)
