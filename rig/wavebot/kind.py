"""The WaveBot as a kind of rig: heave and surge axes, magnetic spring, load cells, power."""

from controllers import impedance, magnetic_spring
from controllers.signals import Reference
from rig import axis, cycle, power, safety, tare
from rig.safety import OFF, RUN
from rig.sequence import TARE, WAIT_DRIVE, WAIT_STATOR
from rig.wavebot.check import check, heave_zero, surge_zero
from rig.wavebot.state import Params, State, hold, start
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
    if sense.heave.enabled == 1 and (params.surge_on == 0 or sense.surge.enabled == 1):
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
    reference = Reference(held.reference_scale, 0.0)
    if mode == RUN:
        law, wanted = impedance.step(
            params.heave_law, state.heave_law, held.gains, motion.heave, dt
        )
        surge_law, surge_wanted = impedance.step(
            params.surge_law, state.surge_law, held.surge, motion.surge, dt
        )
    else:  # with the law at rest it starts afresh, so a later start ramps its gains up from zero
        law, surge_law = impedance.start(), impedance.start()
        wanted = surge_wanted = axis.NOTHING
    heave, record = axis.control(
        params.heave, state.heave, sense.heave, motion.heave, wanted, 1, mode, dt
    )
    surge_mode = mode if params.surge_on == 1 else OFF
    surge, surge_record = axis.control(
        params.surge, state.surge, sense.surge, motion.surge, surge_wanted, 1, surge_mode, dt
    )
    # The stator stays put in a stop, and is not moved before the tare is over.
    move = 1 if phase != TARE and mode <= RUN else 0
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
        State(heave, law, surge, surge_law, spring, tared, spent, held),
        Command(record.command, surge_record.command, spring.command, held.drive, waves),
        Words(record, surge_record, reference, spent, zeros),
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
