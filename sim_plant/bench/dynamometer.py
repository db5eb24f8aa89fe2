"""The bench as one pure step, and what its sensors read of a state.

In a step: brake, drive, motor, shaft. The shaft is quasi-static: between gearbox and brake nothing
has an inertia that matters at 1.5 s (transmission.follow).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from sim_plant import drive, sensors
from sim_plant.bench import brake, gearbox, load_cell, losses, motor, servo, transmission
from sim_plant.bench.brake import BrakeParams, BrakeState
from sim_plant.bench.gearbox import GearboxParams, GearboxState
from sim_plant.bench.load_cell import LoadCellParams
from sim_plant.bench.losses import DragParams
from sim_plant.bench.motor import Held, MotorParams
from sim_plant.bench.servo import ServoParams, ServoState
from sim_plant.bench.signals import TORQUE, Actuation, Reading
from sim_plant.bench.transmission import TransmissionParams
from sim_plant.drive import DriveParams, DriveState
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

UNMOVED = 1.0e9  # N m: what a clamp holds


class SensorParams(NamedTuple):
    """Encoders, currents, limit switch."""

    motor_counts: CountPerRadian  # of the output
    motor_offset: Count
    shaft_counts: CountPerRadian
    shaft_offset: Count
    current: Channel
    brake_current: Channel
    travel: Radian  # of the shaft to either side, where the limit switch opens


class BenchParams(NamedTuple):
    """Everything the step needs, real floats."""

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
    """Everything the step remembers."""

    drive: DriveState
    servo: ServoState
    gearbox: GearboxState
    brake: BrakeState
    motor_angle: Radian
    motor_velocity: RadianPerSecond
    shaft_angle: Radian
    shaft_velocity: RadianPerSecond  # mean over the last step
    shaft_torque: NewtonMetre  # through the load cell
    friction: NewtonMetre  # of the gearbox, what it could hold in the last step
    power: Watt  # out of the shaft, mean over the last step
    drift: Ratio  # of the load cell


class Moved(NamedTuple):
    """The motor's side after a step."""

    drive: DriveState
    servo: ServoState
    angle: Radian
    velocity: RadianPerSecond
    friction: NewtonMetre  # of the gearbox, what it could hold


def initial(params: BenchParams) -> BenchState:
    """Give the bench at rest at angle 0 with all switched off, teeth in the middle of the gap."""
    return BenchState(
        drive.at_rest(), servo.at_rest(params.servo), gearbox.FRESH, brake.initial(params.brake),
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

    `fresh` is 1 if the actuation came since the last step; `stopped` is 1 while the hard-wired
    stop chain is open: the drive's power stage is off. `normals` is the seeded table.
    """
    held_by = brake.step(params.brake, state.brake, actuation.brake_current_a, dt)
    held = _held(params, state, held_by.torque, actuation.locked)
    moved = move_motor(params, state, held, actuation, fresh, stopped, normals, dt)
    shaft = transmission.follow(
        params.transmission, moved.angle, state.shaft_angle, held.forward, held.back
    )
    load = transmission.torque(params.transmission, moved.angle - shaft)
    turned = shaft - state.shaft_angle
    way = moved.angle - state.motor_angle
    return BenchState(
        moved.drive, moved.servo, gearbox.step(params.gearbox, state.gearbox, load, way, normals),
        held_by, moved.angle, moved.velocity, shaft, turned / dt, load, moved.friction,
        load * turned / dt, load_cell.drifted(params.load_cell, state.drift, dt),
    )  # fmt: skip


def move_motor(
    params: BenchParams,
    state: BenchState,
    held: Held,
    actuation: Actuation,
    fresh: Flag,
    stopped: Flag,
    normals: Sequence[float],
    dt: Second,
) -> Moved:
    """Advance drive and motor by dt against what holds the shaft's side."""
    enable, mode, command, current, _, _ = actuation
    if stopped == 1 or abs(state.shaft_angle) > params.sensors.travel:
        enable = 0
    friction = gearbox.friction(params.gearbox, state.gearbox, state.shaft_torque)
    set_point = servo.step(
        params.servo, state.servo, command, state.drive.enabled, state.shaft_torque, normals, dt
    )
    if mode != TORQUE and abs(command) < drive.ABSURD:
        current = _current_of_velocity(params, state, held, set_point.wanted, friction, dt)
    elif mode != TORQUE:
        current = command  # the drive refuses what is no number
    most = motor.ceiling(params.motor, params.drive.current_limit, current, state.motor_velocity)
    driven = drive.drive_step(params.drive, state.drive, current, enable, fresh, 1, 0, most, dt)
    torque = params.motor.torque_per_current * driven.current
    velocity = motor.moved(
        params.motor, params.transmission, held, state.motor_velocity, torque, friction, dt
    )
    angle = state.motor_angle + velocity * dt
    return Moved(driven, set_point, angle, velocity, friction)


def _held(params: BenchParams, state: BenchState, torque: NewtonMetre, locked: Flag) -> Held:
    """Give what opposes the motor in the step to come."""
    ahead = state.motor_angle - state.shaft_angle
    if locked == 1:
        return Held(ahead, UNMOVED, UNMOVED)
    speed = state.shaft_velocity
    forward = torque + losses.forward(params.bearing, speed) + losses.forward(params.seal, speed)
    back = torque + losses.back(params.bearing, speed) + losses.back(params.seal, speed)
    return Held(ahead, forward, back)


def _current_of_velocity(
    params: BenchParams,
    state: BenchState,
    held: Held,
    wanted: RadianPerSecond,
    friction: NewtonMetre,
    dt: Second,
) -> float:
    """Give the current with which the velocity loop follows its set point, within its limit, A."""
    now = state.motor_velocity
    after = wanted + (now - wanted) * math.exp(-dt / params.servo.time_constant)
    torque = motor.needed(params.motor, params.transmission, held, now, after, friction, dt)
    current = torque / params.motor.torque_per_current
    return max(-params.drive.current_limit, min(current, params.drive.current_limit))


def sample(
    params: BenchParams, state: BenchState, e_stop: Flag, tick: int, normals: Sequence[float]
) -> Reading:
    """Give what the sensors read at a state; `tick` is the clock of the noise table."""
    chosen = params.sensors
    carried = load_cell.wrench(params.load_cell, state.shaft_angle, state.shaft_torque)
    told = load_cell.read(params.load_cell, carried, state.drift, tick, normals)
    return Reading(
        sensors.count(chosen.motor_counts, chosen.motor_offset, state.motor_angle),
        sensors.count(chosen.shaft_counts, chosen.shaft_offset, state.shaft_angle),
        sensors.measure(chosen.current, state.drive.current, tick, normals),
        state.drive.enabled,
        state.drive.fault,
        told.fx,
        told.fy,
        told.fz,
        told.tx,
        told.ty,
        told.tz,
        sensors.measure(chosen.brake_current, state.brake.current, tick, normals),
        e_stop,
        1 if abs(state.shaft_angle) > chosen.travel else 0,
    )
