"""The WaveBot as a kind of rig: heave and surge axes, magnetic spring, load cells, power."""

from collections.abc import Callable
from functools import cache
from math import floor
from typing import Any

from controllers import (
    drive_gating,
    impedance,
    magnetic_spring,
    open_loop,
    position_hold,
    signal_generator,
    station_keeping,
)
from controllers.signals import Demand, DriveCommand, Reference
from rig.kinds.wavebot.tick import power_checks, stations, tare
from rig.kinds.wavebot.tick.check import check
from rig.kinds.wavebot.tick.reasons import REASONS, WaveBotReason
from rig.kinds.wavebot.tick.signals import Command, Motion, Sense, TickSignals, WaveBotRow
from rig.kinds.wavebot.tick.state import (
    REFERENCE_SURGE,
    SURGE_HOLD,
    SURGE_OFF,
    SURGE_STATION_KEEPING,
    ActiveSetpoint,
    Laws,
    Params,
    State,
    law_functions,
    zeros_in_use,
)
from rig.laws import from_request
from rig.realtime import axis, cycle, safety
from rig.realtime.assessment import Assessed
from rig.realtime.safety import OFF, RUN
from rig.realtime.sequence import TARE, WAIT_ARRIVAL, WAIT_DRIVE


def observe(params: Params, state: State, sense: Sense, periods: int, dt: float) -> Motion:
    """Return the estimated motion of both axes relative to the zeros in use."""
    heave, surge = sense.heave, sense.surge
    heave_zero, surge_zero = zeros_in_use(params, state, heave, surge)
    return (
        axis.observe(params.heave, state.heave, heave, heave_zero, periods, dt),
        axis.observe(params.surge, state.surge, surge, surge_zero, periods, dt),
    )


def ready(params: Params, state: State, sense: Sense) -> int:
    """Return the flags of the plan's conditions that hold."""
    flags = 0
    if magnetic_spring.arrived(params.spring, state.spring, sense.spring):
        flags = flags | WAIT_ARRIVAL
    if sense.heave.enabled == 1 and (params.surge_use == SURGE_OFF or sense.surge.enabled == 1):
        flags = flags | WAIT_DRIVE
    return flags


_NO_REFERENCE = Reference(0.0, 0.0)


def _raw_sensors(params: Params, sense: Sense) -> tare.RawSensors:
    """Return the present values of the sensors that are tared."""
    load = sense.load
    return tare.RawSensors(
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
    """Return the tick's log row."""
    heave, surge, reference, station_power, zero = signals
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
        sense.load,
        sense.spring,
        spring,
        sense.drive,
        drive,
        sense.power,
        station_power,
        zero,
        sense.probes,
        sense.wave,
        sense.panel,
        tick,
    )


def assessed(row: WaveBotRow) -> Assessed:
    """Return the powers of all stations, and the velocity of heave."""
    power = row.power
    return (
        (power.mechanical_1, power.mechanical_2, power.ac, power.dc),
        row.heave.estimate.velocity,
    )


def _law_stepper(module: Any) -> Callable[..., tuple[Laws, Demand, Reference, int, Demand]]:
    """Return the function that steps all laws, the heave law being that of a module."""
    step_law = module.step

    def step_laws(
        params: Params,
        laws: Laws,
        motion: Motion,
        active_setpoint: ActiveSetpoint,
        saturation_deficit: float,
        wave_clock: float,
        dt: float,
    ) -> tuple[Laws, Demand, Reference, int, Demand]:
        """Step the laws; return state, heave's demand, reference, power stage, surge's demand.

        The power stage's flag is 1 where the drive conducts.
        """
        law, table, generator, gate, keeping, holding = laws
        heave_motion, surge_motion = motion
        reference = _NO_REFERENCE
        if len(params.reference.table) > 0:
            at = floor(wave_clock / dt + 0.5) if wave_clock >= 0.0 else -1
            table, force = open_loop.step(
                params.reference,
                table,
                active_setpoint.reference_scale,
                active_setpoint.realisation,
                at,
                dt,
            )
            reference = Reference(table.scale.value, force)
        signal = active_setpoint.signal
        if not signal_generator.at_rest(generator, signal):
            generator, force = signal_generator.step(
                signal_generator.Params(params.reference.ramp), generator, signal, dt
            )
            reference = Reference(reference.scale, reference.force + force)
        heave_reference = reference.force if params.reference_axis != REFERENCE_SURGE else 0.0
        surge_reference = reference.force - heave_reference
        law, heave_demand = step_law(
            params.heave_law,
            law,
            active_setpoint.law,
            heave_motion,
            heave_reference,
            saturation_deficit,
            dt,
        )
        conducting, threshold = 1, active_setpoint.drive.settings.velocity_threshold
        if threshold > 0.0:
            current = heave_demand.force / params.heave.limits.newtons_per_ampere
            gate, conducting = drive_gating.step(
                params.gate, gate, heave_motion.velocity, current, threshold
            )
        surge_demand, use = axis.NO_DEMAND, params.surge_use
        if use == SURGE_STATION_KEEPING:
            keeping, surge_demand = station_keeping.step(
                params.station_keeping, keeping, active_setpoint.surge, surge_motion, dt
            )
        elif use == SURGE_HOLD:
            holding, surge_demand = position_hold.step(
                params.surge_hold, holding, 0.0, surge_motion, dt
            )
        if surge_reference != 0.0 and use != SURGE_OFF:
            kp, ki, km, force = surge_demand
            surge_demand = Demand(kp, ki, km, force + surge_reference)
        return (
            (law, table, generator, gate, keeping, holding),
            heave_demand,
            reference,
            conducting,
            surge_demand,
        )

    return step_laws


@cache
def kind_with_law(module: Any) -> cycle.Kind:
    """Return the WaveBot with a heave law, given by its module (`controllers.law`).

    The functions that call the law are closures: the tick finds it without a look-up, and compiled
    code has it as a constant.
    """
    step_laws = _law_stepper(module)
    start, laws_at_rest, load_setpoint = law_functions(module)

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
        """Compute a tick's state, commands within limits, and row signals from the set point."""
        heave, surge, tare_state = state.heave, state.surge, state.tare
        laws, active_setpoint = state.laws, state.active_setpoint
        load, analyser, saturated = sense.load, sense.power, sense.drive.saturated
        heave_motion, surge_motion = motion
        phase, wave_clock = plan.phase, plan.wave_clock
        mode = guard.mode
        if setpoint != active_setpoint.setpoint:
            active_setpoint = load_setpoint(params, setpoint)
        if mode == RUN:
            laws, heave_demand, reference, conducting, surge_demand = step_laws(
                params, laws, motion, active_setpoint, heave.saturation_deficit, wave_clock, dt
            )
        else:  # reset the laws, so that a later start ramps its gains up from zero
            laws = laws_at_rest(params)
            heave_demand, surge_demand = axis.NO_DEMAND, axis.NO_DEMAND
            reference, conducting = _NO_REFERENCE, 1
        drive = active_setpoint.drive
        drive = drive if conducting == 1 else DriveCommand(0, drive.settings)
        heave, record = axis.control(
            params.heave,
            heave,
            sense.heave,
            heave_motion,
            heave_demand,
            conducting,
            saturated,
            mode,
            dt,
        )
        surge_mode = OFF if params.surge_use == SURGE_OFF else mode
        surge, surge_record = axis.control(
            params.surge, surge, sense.surge, surge_motion, surge_demand, 1, 0, surge_mode, dt
        )
        # The stator stays put in a stop, before the tare is over, and while all is off.
        move = 1 if phase != TARE and OFF < mode <= RUN else 0
        spring = magnetic_spring.step(
            params.spring, state.spring, active_setpoint.spring_rate, move
        )
        if phase == TARE or tare_state.samples > 0 or tare_state.seeded == 0:
            previous_tare = tare_state
            tare_state = tare.step(tare_state, _raw_sensors(params, sense), phase)
            if previous_tare.seeded == 1:
                heave = axis.rezero(heave, tare_state.zeros.position - previous_tare.zeros.position)
                surge = axis.rezero(surge, tare_state.zeros.surge - previous_tare.zeros.surge)
        zero = tare_state.zeros
        ac, dc, _, _ = analyser
        lcb, trs = load.lcb - zero.lcb, load.trs - zero.trs
        station_power = stations.step(
            state.power,
            lcb=lcb,
            trs=trs,
            slew=load.slew - zero.slew,
            force=record.command.force,
            velocity=heave_motion.velocity,
            surge_force=surge_record.command.force,
            surge_velocity=surge_motion.velocity,
            ac=ac,
            dc=dc,
            phase=phase,
        )
        checks_state = power_checks.step(
            params.power_checks,
            state.power_checks,
            record,
            heave.fade_share,
            saturated,
            lcb,
            trs,
            ac,
            mode,
        )
        waves = 1 if wave_clock >= 0.0 else 0
        return (
            State(
                heave,
                laws,
                surge,
                spring,
                tare_state,
                station_power,
                checks_state,
                active_setpoint,
            ),
            Command(record.command, surge_record.command, spring.command, drive, waves),
            (record, surge_record, reference, station_power, zero),
        )

    return cycle.Kind(
        WaveBotRow,
        Params,
        start,
        observe,
        ready,
        check,
        control,
        row,
        (("heave_law", module.Params),),
        REASONS,
        WaveBotReason.STATOR_LATE.value,
        Sense,
        assessed,
    )


KIND = kind_with_law(impedance)
"""The WaveBot with the impedance law."""


def find_kind(law: str) -> cycle.Kind:
    """Return the WaveBot with the law of a request (`rig.laws.to_request`), empty for impedance.

    Raises LawError if the law's file is not that of the request.
    """
    return KIND if not law else kind_with_law(from_request(law).module)
