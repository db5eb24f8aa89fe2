"""The words on the wires between a rig and the simulated bench.

Angles, velocities and torques are at the gearbox output; a positive torque of the motor on the
shaft acts along positive angle, "clockwise" in the words of the OSWEC thesis.
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
    """What the wires bring to the bench."""

    enable: Flag  # 1: drive asked to be on
    mode: Code  # 0 velocity loop, 1 torque loop
    command_v: Volt  # velocity command, +-10 V
    current_a: Ampere  # motor current asked for in the torque loop
    brake_current_a: Ampere  # brake amplifier
    locked: Flag  # 1: the shaft is clamped behind the load cell


class Reading(NamedTuple):
    """What the wires bring back: values sampled `delay_ticks` ticks ago."""

    motor_counts: Count  # motor encoder, unwrapped, with an arbitrary starting offset
    shaft_counts: Count  # shaft encoder, the same
    current_a: Ampere  # motor
    enabled: Flag
    fault: Code  # 0 none, 1 silence or an absurd command
    fx: Newton  # load cell, in axes that turn with the shaft
    fy: Newton
    fz: Newton
    tx: NewtonMetre
    ty: NewtonMetre
    tz: NewtonMetre  # about the shaft, positive as the motor's torque on the brake
    brake_current_a: Ampere
    e_stop: Flag  # 1: pressed
    limit_switch: Flag  # 1: the shaft is beyond its travel


class Truth(NamedTuple):
    """What no sensor sees, at the present tick."""

    motor_angle: Radian
    motor_velocity: RadianPerSecond
    shaft_angle: Radian
    shaft_velocity: RadianPerSecond
    shaft_torque: NewtonMetre  # through the load cell
    motor_torque: NewtonMetre  # of the current, before the gearbox's friction
    gear_friction: NewtonMetre  # what the gearbox takes, opposing the motor's motion
    brake_torque: NewtonMetre  # what the brake can hold
    brake_power: Watt  # taken out of the shaft by brake, bearing and seal; never negative
    time: Second


OFF = Actuation(0, VELOCITY, 0.0, 0.0, 0.0, 0)
"""Nothing asked for: drive off, brake without current, shaft free."""
