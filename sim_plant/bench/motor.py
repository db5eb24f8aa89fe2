"""Motor, rotor and gearbox as one inertia at the output. Pure.

The step is linearly implicit: friction holds exactly, and the step is stable for any stiffness of
the coupling.
"""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.bench import transmission
from sim_plant.bench.transmission import TransmissionParams
from sim_plant.units import (
    Ampere,
    KilogramSquareMetre,
    NewtonMetre,
    NewtonMetrePerAmpere,
    NewtonMetreSecondPerRadian,
    Radian,
    RadianPerSecond,
    Second,
)


class MotorParams(NamedTuple):
    """Parameters at the gearbox output."""

    inertia: KilogramSquareMetre
    viscous: NewtonMetreSecondPerRadian
    torque_per_current: NewtonMetrePerAmpere
    top_speed: RadianPerSecond  # at which the drive's voltage is exhausted


class ShaftLoad(NamedTuple):
    """Load of the shaft side on the motor in a step."""

    deflection: Radian  # at the start of the step
    forward_friction: NewtonMetre  # dry friction behind the load cell, both not negative
    backward_friction: NewtonMetre


def max_current(
    params: MotorParams, limit: Ampere, current: Ampere, speed: RadianPerSecond
) -> Ampere:
    """Return the current limit by the drive's voltage: reduced in the last 5 % of the speed."""
    if not current * speed > 0.0:
        return limit  # braking
    fraction = (params.top_speed - abs(speed)) / (0.05 * params.top_speed)
    return limit * max(0.0, min(fraction, 1.0))


def coupling_torque(
    spring: TransmissionParams, shaft_load: ShaftLoad, travel: Radian
) -> NewtonMetre:
    """Return the torque through the coupling after a movement: the spring's, up to friction."""
    spring_torque = transmission.torque(spring, shaft_load.deflection + travel)
    return max(-shaft_load.backward_friction, min(spring_torque, shaft_load.forward_friction))


def required_torque(
    params: MotorParams,
    spring: TransmissionParams,
    shaft_load: ShaftLoad,
    velocity: RadianPerSecond,
    next_velocity: RadianPerSecond,
    friction: NewtonMetre,
    dt: Second,
) -> NewtonMetre:
    """Return the motor torque that changes `velocity` to `next_velocity` within dt."""
    inertial_torque = (
        params.inertia * (next_velocity - velocity) / dt + params.viscous * next_velocity
    )
    friction_torque = (
        friction if next_velocity > 0.0 else (-friction if next_velocity < 0.0 else 0.0)
    )
    return (
        inertial_torque + friction_torque + coupling_torque(spring, shaft_load, next_velocity * dt)
    )


def velocity_step(
    params: MotorParams,
    spring: TransmissionParams,
    shaft_load: ShaftLoad,
    velocity: RadianPerSecond,
    torque: NewtonMetre,
    friction: NewtonMetre,
    dt: Second,
) -> RadianPerSecond:
    """Return the velocity after dt under a motor torque."""
    initial_load = coupling_torque(spring, shaft_load, 0.0)
    effective_inertia = params.inertia + dt * params.viscous
    free_velocity = (params.inertia * velocity + dt * (torque - initial_load)) / effective_inertia
    free_travel = free_velocity * dt
    slope = 0.0  # of the load over the free travel
    if abs(free_travel) > 1.0e-12:
        slope = (coupling_torque(spring, shaft_load, free_travel) - initial_load) / free_travel
    effective_inertia += dt * dt * slope
    impulse = params.inertia * velocity + dt * (torque - initial_load)
    friction_impulse = dt * friction
    if impulse > friction_impulse:
        return (impulse - friction_impulse) / effective_inertia
    if impulse < -friction_impulse:
        return (impulse + friction_impulse) / effective_inertia
    return 0.0
