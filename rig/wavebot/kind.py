"""The WaveBot as a kind of rig: heave and surge axes, magnetic spring, load cells, power."""

from math import floor
from typing import NamedTuple

from controllers import (
    drive_gating,
    impedance,
    magnetic_spring,
    open_loop,
    position_hold,
    station_keeping,
)
from controllers.signals import Demand, DriveCommand, Reference
from rig import axis, cycle, power, safety, tare
from rig.safety import OFF, RUN
from rig.sequence import TARE, WAIT_DRIVE, WAIT_STATOR
from rig.wavebot.check import check, heave_zero, surge_zero
from rig.wavebot.state import (
    SURGE_HELD,
    SURGE_KEPT,
    SURGE_OFF,
    Held,
    Laws,
    Params,
    State,
    hold,
    laws_at_rest,
    start,
)
from rig.wavebot.words import Command, Motion, Sense, WaveBotRow, Words


def observe(params: Params, state: State, sense: Sense, periods: int, dt: float) -> Motion:
    """Motion of both axes relative to the zeros in use."""
    zero = heave_zero(params, state, sense)
    heave = axis.observe(params.heave, state.heave, sense.heave, zero, periods, dt)
    zero = surge_zero(params, state, sense)
    return Motion(heave, axis.observe(params.surge, state.surge, sense.surge, zero, periods, dt))


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
) -> tuple[State, Command, Words]:
    """Set point -> forces within limits, stator target, drive settings, wave trigger; and power."""
    phase, mode = plan.phase, guard.mode
    held = state.held
    if setpoint != held.setpoint:
        held = hold(params, setpoint)
    if mode == RUN:
        laws, wanted = _laws(params, state, motion, held, plan.wave_clock, dt)
    else:  # at rest they start afresh, so a later start ramps its gains up from zero
        laws, wanted = laws_at_rest(params), _NOTHING
    drive = held.drive
    if wanted.conducting == 0:
        drive = DriveCommand(0, drive.settings)
    heave, record = axis.control(
        params.heave,
        state.heave,
        sense.heave,
        motion.heave,
        wanted.heave,
        wanted.conducting,
        mode,
        dt,
    )
    surge_mode = mode if params.surge_use != SURGE_OFF else OFF
    surge, surge_record = axis.control(
        params.surge, state.surge, sense.surge, motion.surge, wanted.surge, 1, surge_mode, dt
    )
    # The stator stays put in a stop, and is not moved before the tare is over or while all is off.
    move = 1 if phase != TARE and OFF < mode <= RUN else 0
    spring = magnetic_spring.step(params.spring, state.spring, held.spring_rate, move)
    load, meter, tared = sense.load, sense.power, state.tare
    if phase == TARE or tared.samples > 0 or tared.seeded == 0:
        before, tared = tared, tare.step(tared, _raw(params, sense), phase)
        if before.seeded == 1:
            heave = axis.rezero(heave, tared.zeros.position - before.zeros.position)
            surge = axis.rezero(surge, tared.zeros.surge - before.zeros.surge)
    zeros = tared.zeros
    lcb, trs = load.lcb - zeros.lcb, load.trs - zeros.trs
    spent = power.step(state.power, lcb, trs, motion.heave.velocity, meter.ac, meter.dc, phase)
    waves = 1 if plan.wave_clock >= 0.0 else 0
    return (
        State(heave, laws, surge, spring, tared, spent, held),
        Command(record.command, surge_record.command, spring.command, drive, waves),
        Words(record, surge_record, wanted.reference, spent, zeros),
    )


class _Wanted(NamedTuple):
    """What the laws ask for in a tick."""

    heave: Demand
    reference: Reference
    conducting: int
    surge: Demand


_NO_REFERENCE = Reference(0.0, 0.0)
_NOTHING = _Wanted(axis.NOTHING, _NO_REFERENCE, 1, axis.NOTHING)


def _laws(
    params: Params, state: State, motion: Motion, held: Held, wave_clock: float, dt: float
) -> tuple[Laws, _Wanted]:
    """Demands of heave and surge, and whether the heave drive's power stage may rest."""
    law, table, gate, keeping, holding = state.laws
    reference = _NO_REFERENCE
    if len(params.reference.table) > 0:
        at = floor(wave_clock / dt + 0.5) if wave_clock >= 0.0 else -1
        table, force = open_loop.step(params.reference, table, held.reference_scale, at, dt)
        reference = Reference(table.scale.value, force)
    law, heave = impedance.step(
        params.heave_law, law, held.gains, motion.heave, reference.force, state.heave.short, dt
    )
    conducting, threshold = 1, held.drive.settings.velocity_threshold
    if threshold > 0.0:
        current = heave.force / params.heave.limits.newtons_per_ampere
        gate, conducting = drive_gating.step(
            params.gate, gate, motion.heave.velocity, current, threshold
        )
    surge = axis.NOTHING
    if params.surge_use == SURGE_KEPT:
        keeping, surge = station_keeping.step(
            params.station_keeping, keeping, held.surge, motion.surge, dt
        )
    elif params.surge_use == SURGE_HELD:
        holding, surge = position_hold.step(params.surge_hold, holding, 0.0, motion.surge, dt)
    return (
        Laws(law, table, gate, keeping, holding),
        _Wanted(heave, reference, conducting, surge),
    )


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
    words: Words,
) -> WaveBotRow:
    """The tick's log row."""
    heave, surge, reference, spent, zeros = words
    return WaveBotRow(
        tick,
        time,
        timing,
        plan,
        guard,
        heave,
        surge,
        reference,
        sense.load,
        sense.spring,
        command.spring,
        sense.drive,
        command.drive,
        sense.power,
        spent,
        zeros,
        sense.probes,
        sense.wave,
        tick,
    )


KIND = cycle.Kind(WaveBotRow, Params, start, observe, ready, check, control, row)
