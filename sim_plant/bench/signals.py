"""Signals on the wires between a rig and the simulated bench.

Angles, velocities and torques are at the gearbox output; a positive torque of the motor on the
shaft acts in positive direction, "clockwise" in the OSWEC thesis.
"""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.units import (
    Ampere,
    Code,
    Count,
    Flag,
    Newton,
    NewtonMetre,
    Radian,
    RadianPerSecond,
    Second,
    Volt,
    Watt,
)

VELOCITY, TORQUE = 0, 1


class Actuation(NamedTuple):
    """Commands from the control computer to the bench."""

    enable: Flag  # 1: drive enable is requested
    mode: Code  # 0 velocity loop, 1 torque loop
    command_v: Volt  # velocity command, +-10 V
    current_a: Ampere  # commanded motor current of the torque loop
    brake_current_a: Ampere  # brake amplifier
    locked: Flag  # 1: the shaft is clamped behind the load cell


class BenchReading(NamedTuple):
    """Measurements from the bench: values sampled `delay_ticks` ticks ago."""

    motor_counts: Count  # motor encoder, unwrapped, with an arbitrary starting offset
    shaft_counts: Count  # shaft encoder, likewise
    current_a: Ampere  # motor
    enabled: Flag
    fault: Code  # 0 none, 1 no command in time, or an implausible command
    fx: Newton  # load cell, in axes that turn with the shaft
    fy: Newton
    fz: Newton
    tx: NewtonMetre
    ty: NewtonMetre
    tz: NewtonMetre  # about the shaft, positive like the motor's torque on the brake
    brake_current_a: Ampere
    e_stop: Flag  # 1: pressed
    limit_switch: Flag  # 1: the shaft is beyond its travel


class BenchTruth(NamedTuple):
    """True state at the present tick."""

    motor_angle: Radian
    motor_velocity: RadianPerSecond
    shaft_angle: Radian
    shaft_velocity: RadianPerSecond
    shaft_torque: NewtonMetre  # through the load cell
    motor_torque: NewtonMetre  # of the current, before the gearbox's friction
    gear_friction: NewtonMetre  # of the gearbox, opposing the motor's motion
    brake_torque: NewtonMetre  # holding torque of the brake
    brake_power: Watt  # taken out of the shaft by brake, bearing and seal; never negative
    time: Second


OFF = Actuation(0, VELOCITY, 0.0, 0.0, 0.0, 0)
"""No request: drive off, brake without current, shaft free."""
