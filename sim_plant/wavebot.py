"""WaveBot in heave as one pure step: drive, motor, spring, stator, body and power analyser.

Explicit midpoint rule: at 1 ms the position error is below 3e-6 of the stroke, of second order.
Force is on the body; absorbed power is negative.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sim_plant import body, drive, magnetic_spring, pto, sensors
from sim_plant.body import BodyParams, BodyState
from sim_plant.drive import AnalyserState, DriveParams, DriveState
from sim_plant.magnetic_spring import SpringParams, StatorState
from sim_plant.pto import PtoParams
from sim_plant.sensors import Channel
from sim_plant.units import (
    Ampere,
    Code,
    Count,
    CountPerMetre,
    Flag,
    Metre,
    Newton,
    Percent,
    Radian,
    Second,
    Volt,
    Watt,
)


class Actuation(NamedTuple):
    """What the wires bring to the rig."""

    heave_current: Ampere  # commanded drive current, F/(Kt N)
    heave_enable: Flag  # 1: drive asked to be on
    stator_target: Percent
    stator_enable: Flag  # 1: actuator follows its target, 0: holds where it is
    wave_trigger: Flag  # 1: wave maker runs; its rising edge is t = 0 of the wave clock
    surge_current: Ampere  # commanded drive current, F/(Kt N)
    surge_enable: Flag
    conducting: Flag  # 0: the custom drive's power stage is gated off (no torque)


class Readings(NamedTuple):
    """What the wires bring back: values sampled `delay_ticks` ticks ago."""

    heave_counts: Count  # motor encoder, with an arbitrary starting offset
    heave_current: Ampere
    heave_enabled: Flag
    heave_fault: Code  # 0 none, 1 general, 2 undervoltage, 3 overvoltage
    surge_counts: Count
    surge_current: Ampere
    surge_enabled: Flag
    surge_fault: Code
    force_lcb: Newton  # column load cell, force on the body
    force_trs: Newton  # shaft torque sensor as linear force on the body
    force_slew: Newton  # spring torque over its 0.254 m lever, positive as it restores
    force_stator_a: Newton  # axial force of the magnetic spring's stator: A + B
    force_stator_b: Newton
    string_pot: Metre  # second, independent heave position
    rotor_angle: Radian
    stator_position: Percent
    stator_arrived: Flag  # 1: at target and at rest
    power_ac: Watt  # mean over the analyser's own window, absorbed negative
    power_dc: Watt
    bus_voltage: Volt
    analyser_age: Second  # time since the analyser's last value
    drive_saturated: Flag  # 1: the heave drive gives less current than asked for
    drive_dump: Code  # mask of the dump resistors that conduct now
    drive_conducting: Flag  # 1: the heave drive's power stage switches
    elevation: Metre  # undisturbed at the device (truth)
    probe_1: Metre  # basin probes: undisturbed plus radiated wave at their places
    probe_2: Metre
    probe_3: Metre
    probe_age: Second  # time since the probes' last sample


class SensorParams(NamedTuple):
    """Scale of the encoder and errors of the analog channels."""

    counts_per_metre: CountPerMetre
    count_offset: Count
    current: Channel
    string_pot: Channel
    force_lcb: Channel
    force_trs: Channel
    rotor_angle: Channel


class WaveBotParams(NamedTuple):
    """Everything the step needs, real floats."""

    body: BodyParams
    pto: PtoParams
    spring: SpringParams
    drive: DriveParams
    sensors: SensorParams


class WaveBotState(NamedTuple):
    """Everything the step remembers; `passive` is spring + drivetrain friction at this state."""

    body: BodyState
    drive: DriveState
    stator: StatorState
    analyser: AnalyserState
    passive: Newton


def initial(params: WaveBotParams, stator: Percent, position: Metre) -> WaveBotState:
    """Give the state at rest at a heave position (m) and a stator position (%), drive off."""
    rate = magnetic_spring.table_rate(params.spring, stator)
    loss = params.drive.fixed_loss
    return WaveBotState(
        BodyState(position, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        DriveState(0.0, 0.0, 0, 0, 0.0, 0.0),
        StatorState(stator, rate, 1),
        AnalyserState(0.0, 0.0, 0, 0.0, loss, 0.0),
        magnetic_spring.force(params.spring, rate, position),
    )


def passive_force(
    spring: SpringParams, pto_params: PtoParams, rate: float, position: float, velocity: float
) -> Newton:
    """Give spring plus drivetrain friction, the two forces between TRS and LCB, N on the body."""
    return magnetic_spring.force(spring, rate, position) + pto.friction(pto_params, velocity)


def step(
    params: WaveBotParams,
    state: WaveBotState,
    actuation: Actuation,
    fresh: int,
    excitation_now: Newton,
    excitation_next: Newton,
    dt: Second,
) -> WaveBotState:
    """Advance the rig by dt under a latched actuation and the excitation at both ends.

    `fresh` is 1 if the actuation came since the last step (the drive's watchdog counts its age).
    Excitation is linear within the step; the motor force is the exact mean of the current loop.
    """
    start, drive_state, stator_state, analyser_state, passive = state
    body_params, pto_params, spring_params, drive_params, _ = params
    current, enable, target, stator_enable, _, _, _, _ = actuation
    driven = drive.drive_step(drive_params, drive_state, current, enable, fresh, dt)
    mean_current = driven.mean_current
    motor = pto_params.force_per_current * mean_current

    applied = excitation_now + motor + passive
    x, v = body.predict(body_params, start, applied, 0.5 * dt)
    passive = passive_force(spring_params, pto_params, stator_state.rate, x, v)
    applied = 0.5 * (excitation_now + excitation_next) + motor + passive
    end = body.correct(body_params, start, x, v, applied, dt)

    stator = magnetic_spring.stator_step(spring_params, stator_state, target, stator_enable, dt)
    passive = passive_force(spring_params, pto_params, stator.rate, end.position, end.velocity)
    power_ac = motor * v + pto_params.copper * motor * motor
    power_dc = power_ac + drive.drive_loss(drive_params, mean_current)
    analyser = drive.analyser_step(drive_params, analyser_state, power_ac, power_dc, dt)
    return WaveBotState(end, driven, stator, analyser, passive)


def sample(
    params: WaveBotParams,
    state: WaveBotState,
    tick: int,
    elevation: Metre,
    normals: Sequence[float],
) -> Readings:
    """Give what the sensors read at a state; `normals` is the noise table, `tick` its clock."""
    body_state, drive_state, stator, analyser, passive = state
    current, _, enabled, fault, _, _ = drive_state
    stator_position, _, arrived = stator
    _, _, _, power_ac, power_dc, analyser_age = analyser
    scale, offset, ammeter, pot, lcb, trs, rotor = params.sensors
    position = body_state.position
    motor = params.pto.force_per_current * current
    angle = params.spring.angle_per_metre * position
    return Readings(
        sensors.count(scale, offset, position),
        sensors.measure(ammeter, current, tick, normals),
        enabled,
        fault,
        0,
        0.0,
        0,
        0,
        sensors.measure(lcb, motor + passive, tick, normals),
        sensors.measure(trs, motor, tick, normals),
        0.0,
        0.0,
        0.0,
        sensors.measure(pot, position, tick, normals),
        sensors.measure(rotor, angle, tick, normals),
        stator_position,
        arrived,
        power_ac,
        power_dc,
        drive.bus_voltage(params.drive, power_dc),
        analyser_age,
        0,
        0,
        enabled,
        elevation,
        elevation,
        elevation,
        elevation,
        0.0,
    )


def wave_ramp(wave_time: Second, duration: Second) -> float:
    """Give the onset factor of the waves, 0..1: half a cosine over `duration`, then exactly 1."""
    if not wave_time < duration:
        return 1.0
    if not wave_time > 0.0:
        return 0.0
    return 0.5 - 0.5 * math.cos(math.pi * wave_time / duration)
