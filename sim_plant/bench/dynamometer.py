"""The bench as one pure step, and its sensor readings.

A step updates brake, drive, motor and shaft. The shaft is quasi-static: between gearbox and brake
no inertia matters at a period of 1.5 s (transmission.follow).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sim_plant import sensors
from sim_plant.bench import brake, gearbox, load_cell, losses, motor, servo, transmission
from sim_plant.bench.brake import BrakeParams, BrakeState
from sim_plant.bench.gearbox import GearboxParams, GearboxState
from sim_plant.bench.load_cell import LoadCellParams
from sim_plant.bench.losses import DragParams
from sim_plant.bench.motor import MotorParams, ShaftLoad
from sim_plant.bench.servo import ServoParams, ServoState
from sim_plant.bench.signals import TORQUE, Actuation, BenchReading
from sim_plant.bench.transmission import TransmissionParams
from sim_plant.parts import drive
from sim_plant.parts.drive import DriveParams, DriveState
from sim_plant.sensors import Channel
from sim_plant.units import (
    Count,
    CountPerRadian,
    Flag,
    NewtonMetre,
    Radian,
    RadianPerSecond,
    Ratio,
    Second,
    Watt,
)

CLAMP_TORQUE = 1.0e9  # N m: holding torque of a clamp


class SensorParams(NamedTuple):
    """Encoders, currents, limit switch."""

    motor_counts: CountPerRadian  # per radian at the output
    motor_offset: Count
    shaft_counts: CountPerRadian
    shaft_offset: Count
    current: Channel
    brake_current: Channel
    travel: Radian  # of the shaft in either direction before the limit switch opens


class BenchParams(NamedTuple):
    """Parameters of the step, as floats."""

    drive: DriveParams
    servo: ServoParams
    motor: MotorParams
    gearbox: GearboxParams
    transmission: TransmissionParams
    bearing: DragParams
    seal: DragParams
    brake: BrakeParams
    load_cell: LoadCellParams
    sensors: SensorParams


class BenchState(NamedTuple):
    """State of the step."""

    drive: DriveState
    servo: ServoState
    gearbox: GearboxState
    brake: BrakeState
    motor_angle: Radian
    motor_velocity: RadianPerSecond
    shaft_angle: Radian
    shaft_velocity: RadianPerSecond  # mean over the last step
    shaft_torque: NewtonMetre  # through the load cell
    friction: NewtonMetre  # of the gearbox: largest friction torque in the last step
    power: Watt  # out of the shaft, mean over the last step
    drift: Ratio  # of the load cell


class MotorStep(NamedTuple):
    """State of the motor side after a step."""

    drive: DriveState
    servo: ServoState
    angle: Radian
    velocity: RadianPerSecond
    friction: NewtonMetre  # of the gearbox: largest friction torque


def initial(params: BenchParams) -> BenchState:
    """Return the bench at rest at angle 0, switched off, the teeth in the middle of the gap."""
    return BenchState(
        drive.initial(), servo.initial(params.servo), gearbox.INITIAL, brake.initial(params.brake),
        0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    )  # fmt: skip


def step(
    params: BenchParams,
    state: BenchState,
    actuation: Actuation,
    fresh: Flag,
    stopped: Flag,
    normals: Sequence[float],
    dt: Second,
) -> BenchState:
    """Advance the bench by dt under a latched actuation.

    `fresh` is 1 if the actuation arrived since the last step; `stopped` is 1 while the hard-wired
    stop chain is open: the drive's power stage is off. `normals` is the seeded table.
    """
    brake_state = brake.step(params.brake, state.brake, actuation.brake_current_a, dt)
    shaft_load = _shaft_load(params, state, brake_state.torque, actuation.locked)
    motor_step = move_motor(params, state, shaft_load, actuation, fresh, stopped, normals, dt)
    shaft = transmission.follow(
        params.transmission,
        motor_step.angle,
        state.shaft_angle,
        shaft_load.forward_friction,
        shaft_load.backward_friction,
    )
    load = transmission.torque(params.transmission, motor_step.angle - shaft)
    shaft_travel = shaft - state.shaft_angle
    motor_travel = motor_step.angle - state.motor_angle
    return BenchState(
        motor_step.drive, motor_step.servo,
        gearbox.step(params.gearbox, state.gearbox, load, motor_travel, normals), brake_state,
        motor_step.angle, motor_step.velocity, shaft, shaft_travel / dt, load, motor_step.friction,
        load * shaft_travel / dt, load_cell.drift_step(params.load_cell, state.drift, dt),
    )  # fmt: skip


def move_motor(
    params: BenchParams,
    state: BenchState,
    shaft_load: ShaftLoad,
    actuation: Actuation,
    fresh: Flag,
    stopped: Flag,
    normals: Sequence[float],
    dt: Second,
) -> MotorStep:
    """Advance drive and motor by dt against the load of the shaft side."""
    enable, mode, command, current, _, _ = actuation
    if stopped == 1 or abs(state.shaft_angle) > params.sensors.travel:
        enable = 0
    friction = gearbox.friction(params.gearbox, state.gearbox, state.shaft_torque)
    servo_state = servo.step(
        params.servo, state.servo, command, state.drive.enabled, state.shaft_torque, normals, dt
    )
    if mode != TORQUE and abs(command) < drive.MAX_PLAUSIBLE_CURRENT:
        current = _velocity_loop_current(
            params, state, shaft_load, servo_state.set_point, friction, dt
        )
    elif mode != TORQUE:
        current = command  # the drive rejects a command that is not a number
    max_current = motor.max_current(
        params.motor, params.drive.current_limit, current, state.motor_velocity
    )
    drive_state = drive.drive_step(
        params.drive, state.drive, current, enable, fresh, 1, 0, max_current, dt
    )
    torque = params.motor.torque_per_current * drive_state.current
    velocity = motor.velocity_step(
        params.motor, params.transmission, shaft_load, state.motor_velocity, torque, friction, dt
    )
    angle = state.motor_angle + velocity * dt
    return MotorStep(drive_state, servo_state, angle, velocity, friction)


def _shaft_load(
    params: BenchParams, state: BenchState, torque: NewtonMetre, locked: Flag
) -> ShaftLoad:
    """Return the load that opposes the motor in the next step."""
    deflection = state.motor_angle - state.shaft_angle
    if locked == 1:
        return ShaftLoad(deflection, CLAMP_TORQUE, CLAMP_TORQUE)
    speed = state.shaft_velocity
    forward = (
        torque
        + losses.forward_torque(params.bearing, speed)
        + losses.forward_torque(params.seal, speed)
    )
    backward = (
        torque
        + losses.backward_torque(params.bearing, speed)
        + losses.backward_torque(params.seal, speed)
    )
    return ShaftLoad(deflection, forward, backward)


def _velocity_loop_current(
    params: BenchParams,
    state: BenchState,
    shaft_load: ShaftLoad,
    set_point: RadianPerSecond,
    friction: NewtonMetre,
    dt: Second,
) -> float:
    """Return the current that makes the velocity loop follow its set point, within its limit, A."""
    velocity = state.motor_velocity
    next_velocity = set_point + (velocity - set_point) * math.exp(-dt / params.servo.time_constant)
    torque = motor.required_torque(
        params.motor, params.transmission, shaft_load, velocity, next_velocity, friction, dt
    )
    current = torque / params.motor.torque_per_current
    return max(-params.drive.current_limit, min(current, params.drive.current_limit))


def sample(
    params: BenchParams, state: BenchState, e_stop: Flag, tick: int, normals: Sequence[float]
) -> BenchReading:
    """Return the sensor readings at a state; `tick` is the index of the noise table."""
    sensor_params = params.sensors
    load = load_cell.wrench(params.load_cell, state.shaft_angle, state.shaft_torque)
    cell = load_cell.read(params.load_cell, load, state.drift, tick, normals)
    return BenchReading(
        sensors.encoder_count(
            sensor_params.motor_counts, sensor_params.motor_offset, state.motor_angle
        ),
        sensors.encoder_count(
            sensor_params.shaft_counts, sensor_params.shaft_offset, state.shaft_angle
        ),
        sensors.measure(sensor_params.current, state.drive.current, tick, normals),
        state.drive.enabled,
        state.drive.fault,
        cell.fx,
        cell.fy,
        cell.fz,
        cell.tx,
        cell.ty,
        cell.tz,
        sensors.measure(sensor_params.brake_current, state.brake.current, tick, normals),
        e_stop,
        1 if abs(state.shaft_angle) > sensor_params.travel else 0,
    )
