"""The WaveBot as a kind of rig: heave axis, magnetic spring, load cells, power at four stations."""

from typing import NamedTuple

from controllers import magnetic_spring
from controllers.blocks import finite
from controllers.signals import (
    AxisCommand,
    AxisSense,
    Estimate,
    Flag,
    Gains,
    Metre,
    Newton,
    Radian,
    Second,
    SpringCommand,
    SpringSense,
    Tick,
    Volt,
    Watt,
)
from rig import axis, cycle, power, safety, tare
from rig.safety import CATEGORY, FINE, RUN, Reason
from rig.sequence import TARE, WAIT_DRIVE, WAIT_STATOR


class LoadSense(NamedTuple):
    """Load cells and the second position sensor."""

    lcb: Newton  # column load cell: force on the body
    trs: Newton  # shaft torque sensor as a linear force on the body
    string_pot: Metre
    rotor_angle: Radian  # of the magnetic spring
    age: Second


class PowerSense(NamedTuple):
    """The power analyser."""

    ac: Watt
    dc: Watt
    bus_voltage: Volt
    age: Second


class WaveSense(NamedTuple):
    """Undisturbed elevation at the device; only a simulated basin knows it (NaN elsewhere)."""

    elevation: Metre


class Sense(NamedTuple):
    """All that is read in a tick."""

    heave: AxisSense
    load: LoadSense
    spring: SpringSense
    power: PowerSense
    wave: WaveSense


class Command(NamedTuple):
    """All that is written in a tick."""

    heave: AxisCommand
    spring: SpringCommand
    wave_trigger: Flag  # 1: the wave maker runs; its rising edge is zero of the wave clock


class WaveBotRow(NamedTuple):
    """One tick of a WaveBot run; tick stands first and last so that a torn row shows."""

    tick: Tick
    time: Second  # planned, since run start
    timing: cycle.Timing
    plan: cycle.PlanRecord
    safety: safety.State
    heave: axis.Record
    load: LoadSense
    spring_sense: SpringSense
    spring_command: SpringCommand
    power_sense: PowerSense
    power: power.Power
    tare: tare.Zeros
    wave: WaveSense
    tick_end: Tick


class Setpoints(NamedTuple):
    """Table of set points by columns, all of one length; a plan segment names its index."""

    kp: tuple[float, ...]  # N*s/m
    ki: tuple[float, ...]  # N/m
    spring_rate: tuple[float, ...]  # N/m


class Limits(NamedTuple):
    """Limits of what is not an axis."""

    string_pot_difference_stop: float  # m
    rotor_travel_stop: float  # m
    metres_per_radian: float  # of the rotor
    stator_age_stop: float  # s
    load_cell_age_stop: float  # s
    analyser_age_stop: float  # s
    tare_span_stop: float  # m


class Params(NamedTuple):
    """Constants of a WaveBot run."""

    heave: axis.Params
    spring: magnetic_spring.Params
    limits: Limits
    setpoints: Setpoints


class State(NamedTuple):
    """Memory of a WaveBot run."""

    heave: axis.State
    spring: magnetic_spring.State
    tare: tare.State
    power: power.Power
    setpoint: int  # index of the set point in use, -1: none yet
    gains: Gains  # of that set point


Words = tuple[axis.Record, power.Power, tare.Zeros]  # the WaveBot's own part of a row


def start() -> State:
    """State before the first tick."""
    none = Gains(0.0, 0.0, 0.0)
    return State(axis.start(), magnetic_spring.start(), tare.start(), power.start(), -1, none)


def observe(params: Params, state: State, sense: Sense, periods: int, dt: float) -> Estimate:
    """Heave motion relative to the zero in use."""
    zero = _zero(params, state, sense)
    return axis.observe(params.heave, state.heave, sense.heave, zero, periods, dt)


def _zero(params: Params, state: State, sense: Sense) -> float:
    """The zero of heave in use (m in the encoder's frame), at first where the body is found."""
    if state.tare.seeded == 0:
        return sense.heave.counts * params.heave.metres_per_count
    return state.tare.zeros.position


def check(params: Params, state: State, sense: Sense, motion: Estimate, mode: int) -> int:
    """The first reason to trip, those that allow no controlled stop before others, or NONE."""
    heave, load, spring, meter, _ = sense
    reason = axis.check(params.heave, state.heave, heave, motion, _zero(params, state, sense), mode)
    if reason != FINE and CATEGORY[reason] == 0:
        return reason
    lcb, trs, string_pot, rotor_angle, load_age = load
    stator, _, stator_age = spring
    ac, dc, bus_voltage, meter_age = meter
    # One sum instead of many tests: it is finite only if every term is.
    total = lcb + trs + string_pot + rotor_angle + load_age + stator + stator_age
    if not finite(total + ac + dc + bus_voltage + meter_age):
        return Reason.NOT_FINITE.value
    bounds, tared = params.limits, state.tare
    stale = load_age > bounds.load_cell_age_stop
    zero = tared.zeros.string_pot if tared.seeded == 1 else string_pot
    gap, most = string_pot - zero - motion.position, bounds.string_pot_difference_stop
    if not (-most <= gap <= most or stale):
        return Reason.POSITION_DISAGREES.value
    if reason != FINE:  # damping trusts the encoder, so the string pot is asked first
        return reason
    if stale:
        return Reason.STALE_LOAD_CELL.value
    if meter_age > bounds.analyser_age_stop:
        return Reason.STALE_ANALYSER.value
    if stator_age > bounds.stator_age_stop:
        return Reason.STALE_STATOR.value
    travel, most = rotor_angle * bounds.metres_per_radian, bounds.rotor_travel_stop
    if not -most <= travel <= most:
        return Reason.ROTOR_TRAVEL.value
    if tared.highest - tared.lowest > bounds.tare_span_stop:
        return Reason.NOT_CALM.value
    return FINE


def ready(params: Params, state: State, sense: Sense) -> int:
    """Which conditions of the plan hold."""
    flags = 0
    if magnetic_spring.arrived(params.spring, state.spring, sense.spring):
        flags = flags | WAIT_STATOR
    if sense.heave.enabled == 1:
        flags = flags | WAIT_DRIVE
    return flags


def control(
    params: Params,
    state: State,
    sense: Sense,
    motion: Estimate,
    plan: cycle.PlanRecord,
    guard: safety.State,
    setpoint: int,
    dt: float,
) -> tuple[State, Command, Words]:
    """Set point -> heave force within limits, stator target, wave trigger; and power."""
    table, phase, mode = params.setpoints, plan.phase, guard.mode
    gains = state.gains
    if setpoint != state.setpoint:
        gains = Gains(table.kp[setpoint], table.ki[setpoint], 0.0)
    heave, record = axis.control(params.heave, state.heave, sense.heave, motion, gains, mode, dt)
    # The stator stays put in a stop, and is not moved before the tare is over.
    move = 1 if phase != TARE and mode <= RUN else 0
    spring = magnetic_spring.step(params.spring, state.spring, table.spring_rate[setpoint], move)
    load, meter, tared = sense.load, sense.power, state.tare
    if phase == TARE or tared.samples > 0 or tared.seeded == 0:
        counted = sense.heave.counts * params.heave.metres_per_count
        raw = tare.Raw(counted, load.string_pot, load.lcb, load.trs)
        before, tared = tared, tare.step(tared, raw, phase)
        if before.seeded == 1:
            heave = axis.rezero(heave, tared.zeros.position - before.zeros.position)
    zeros = tared.zeros
    lcb, trs = load.lcb - zeros.lcb, load.trs - zeros.trs
    spent = power.step(state.power, lcb, trs, motion.velocity, meter.ac, meter.dc, phase)
    waves = 1 if plan.wave_clock >= 0.0 else 0
    after = State(heave, spring, tared, spent, setpoint, gains)
    return after, Command(record.command, spring.command, waves), (record, spent, zeros)


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
    heave, spent, zeros = words
    return WaveBotRow(
        tick,
        time,
        timing,
        plan,
        guard,
        heave,
        sense.load,
        sense.spring,
        command.spring,
        sense.power,
        spent,
        zeros,
        sense.wave,
        tick,
    )


KIND = cycle.Kind(WaveBotRow, Params, start, observe, ready, check, control, row)
