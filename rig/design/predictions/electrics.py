"""From motor force to power at the stations: copper loss, the drive's losses, what the bus gives.

Powers are means of products over the record itself, so |i| and i^2 need no assumption on how
current is distributed. Absorbed power is negative.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rig.design.predictions.grid import Floats

NO_CEILING = 1e9  # V


class Motor(NamedTuple):
    """The heave motor."""

    newtons_per_ampere: float  # of drive current, Kt N
    copper: float  # W/N^2: R / (3/2 Kt^2 N^2)
    back_emf: float  # V per m/s of the two-port: sqrt(3/2) Kt N
    resistance: float  # ohm


class Drive(NamedTuple):
    """Losses and voltage of the drive, rows by 1; P = fixed + [on](standing + a |i| + b i^2)."""

    fixed: Floats  # W
    standing: Floats  # W while the power stage switches
    linear: Floats  # W/A
    square: Floats  # W/A^2
    ceiling: Floats  # V, largest that it can put on the motor; NO_CEILING: not limited
    rests_below: Floats  # m/s: slower than this the power stage rests; 0: never
    rests_within: Floats  # A: and only at less current than this; 0: whatever the current


class Stations(NamedTuple):
    """Mean power of each row, W."""

    mechanical_1: Floats
    mechanical_2: Floats
    ac: Floats
    dc: Floats
    dc_record: Floats  # W, rows by samples


def conducts(drive: Drive, motor: Motor, force: Floats, velocity: Floats) -> Floats:
    """1 where the power stage switches (`controllers.drive_gating`, without hysteresis)."""
    within = drive.rests_within * motor.newtons_per_ampere
    little = (np.abs(force) < within) | (within == 0.0)
    return np.where(little & (np.abs(velocity) < drive.rests_below), 0.0, 1.0)


def commanded(drive: Drive, motor: Motor, most: float, demand: Floats, velocity: Floats) -> Floats:
    """Force that current limit and gating leave of a demand, N; ``most`` (A) is the peak."""
    largest = most * motor.newtons_per_ampere
    force = np.clip(demand, -largest, largest)
    if np.any(drive.rests_below > 0.0):
        force = force * conducts(drive, motor, demand, velocity)
    return force


def granted(drive: Drive, motor: Motor, command: Floats, velocity: Floats) -> Floats:
    """Force that the bus voltage leaves of a commanded one, N."""
    if not np.any(drive.ceiling < NO_CEILING):
        return command
    left = np.maximum(drive.ceiling - motor.back_emf * np.abs(velocity), 0.0)
    largest = motor.back_emf * left / motor.resistance
    return np.clip(command, -largest, largest)


def stations(
    drive: Drive,
    motor: Motor,
    force: Floats,
    demand: Floats,
    velocity: Floats,
    passive: Floats,
    seen: Floats,
) -> Stations:
    """Power at the four stations for motor and passive force (N on the body).

    ``seen`` is the velocity as the rig estimates it, which is what its mechanical power is made of.
    """
    shaft = force * velocity
    ac = shaft + motor.copper * force * force
    size = np.abs(force) / motor.newtons_per_ampere
    on = conducts(drive, motor, demand, velocity)
    loss = drive.fixed + on * (drive.standing + (drive.linear + drive.square * size) * size)
    dc = ac + loss
    return Stations(
        _mean((force + passive) * seen),
        _mean(force * seen),
        _mean(ac),
        _mean(dc),
        dc,
    )


def need(motor: Motor, velocity: Floats, force: Floats) -> Floats:
    """Voltage that the motor asks for, V: back-EMF and winding, whichever way power flows."""
    winding = motor.resistance * np.abs(force) / motor.back_emf
    asked: Floats = motor.back_emf * np.abs(velocity) + winding
    return asked


def held(on_step: float, current: Floats, time_constant: float) -> Floats:
    """Peak over the period of the current's rms as the limiter averages it, A."""
    square = np.fft.rfft(current * current, axis=-1)
    omega = 2.0 * np.pi * np.fft.rfftfreq(current.shape[-1], on_step)
    mean = np.fft.irfft(square / (1.0 + 1j * omega * time_constant), current.shape[-1], axis=-1)
    peak: Floats = np.sqrt(np.maximum(mean.max(axis=-1), 0.0))
    return peak


def _mean(record: Floats) -> Floats:
    mean: Floats = record.mean(axis=1)
    return mean
