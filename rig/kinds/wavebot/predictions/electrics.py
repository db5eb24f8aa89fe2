"""Power at the stations from motor force: copper loss, drive losses, limits of the bus voltage.

Powers are means of products over the record itself, so |i| and i^2 need no assumption about the
distribution of the current. Absorbed power is negative.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from rig.design.grid import Floats

NO_VOLTAGE_LIMIT = 1e9  # V


class Motor(NamedTuple):
    """The heave motor."""

    newtons_per_ampere: float  # of drive current, Kt N
    copper: float  # W/N^2: R / (3/2 Kt^2 N^2)
    back_emf: float  # V per m/s of the two-port: sqrt(3/2) Kt N
    resistance: float  # ohm


class Drive(NamedTuple):
    """Losses and voltage limit of the drive, arrays of rows by 1.

    P = fixed + [on] (active + linear |i| + quadratic i^2)
    """

    fixed: Floats  # W
    active: Floats  # W, while the power stage switches
    linear: Floats  # W/A
    quadratic: Floats  # W/A^2
    voltage_limit: Floats  # V, largest motor voltage; NO_VOLTAGE_LIMIT: not limited
    gating_velocity: Floats  # m/s: the power stage is off at lower speed; 0: never off
    gating_current: Floats  # A: and only off at lower current; 0: at any current


class StationPowers(NamedTuple):
    """Mean power of each row, W."""

    mechanical_1: Floats
    mechanical_2: Floats
    ac: Floats
    dc: Floats
    dc_record: Floats  # W, rows by samples


def is_conducting(drive: Drive, motor: Motor, force: Floats, velocity: Floats) -> Floats:
    """Return 1 where the power stage switches (`controllers.drive_gating`, no hysteresis)."""
    force_threshold = drive.gating_current * motor.newtons_per_ampere
    low_current = (np.abs(force) < force_threshold) | (force_threshold == 0.0)
    return np.where(low_current & (np.abs(velocity) < drive.gating_velocity), 0.0, 1.0)


def current_limited_force(
    drive: Drive, motor: Motor, current_limit: float, demand: Floats, velocity: Floats
) -> Floats:
    """Return the demanded force after current limit (A, peak) and gating, N."""
    force_limit = current_limit * motor.newtons_per_ampere
    force = np.clip(demand, -force_limit, force_limit)
    if np.any(drive.gating_velocity > 0.0):
        force = force * is_conducting(drive, motor, demand, velocity)
    return force


def voltage_limited_force(drive: Drive, motor: Motor, command: Floats, velocity: Floats) -> Floats:
    """Return the commanded force after the limit of the bus voltage, N."""
    if not np.any(drive.voltage_limit < NO_VOLTAGE_LIMIT):
        return command
    voltage_headroom = np.maximum(drive.voltage_limit - motor.back_emf * np.abs(velocity), 0.0)
    force_limit = motor.back_emf * voltage_headroom / motor.resistance
    return np.clip(command, -force_limit, force_limit)


def station_powers(
    drive: Drive,
    motor: Motor,
    force: Floats,
    demand: Floats,
    velocity: Floats,
    passive_force: Floats,
    estimated_velocity: Floats,
) -> StationPowers:
    """Return the power at the four stations for motor and passive force (N on the body).

    ``estimated_velocity`` is the rig's estimate, from which it computes mechanical power.
    """
    shaft = force * velocity
    ac = shaft + motor.copper * force * force
    current = np.abs(force) / motor.newtons_per_ampere
    conducting = is_conducting(drive, motor, demand, velocity)
    loss = drive.fixed + conducting * (
        drive.active + (drive.linear + drive.quadratic * current) * current
    )
    dc = ac + loss
    return StationPowers(
        _mean((force + passive_force) * estimated_velocity),
        _mean(force * estimated_velocity),
        _mean(ac),
        _mean(dc),
        dc,
    )


def required_voltage(motor: Motor, velocity: Floats, force: Floats) -> Floats:
    """Return the voltage that the motor needs, V: back-EMF plus winding, for either power sign."""
    winding = motor.resistance * np.abs(force) / motor.back_emf
    voltage: Floats = motor.back_emf * np.abs(velocity) + winding
    return voltage


def limiter_rms_peak(sample_period: float, current: Floats, time_constant: float) -> Floats:
    """Return the peak over the period of the limiter's moving rms of the current, A."""
    spectrum = np.fft.rfft(current * current, axis=-1)
    omega = 2.0 * np.pi * np.fft.rfftfreq(current.shape[-1], sample_period)
    averaged = np.fft.irfft(
        spectrum / (1.0 + 1j * omega * time_constant), current.shape[-1], axis=-1
    )
    peak: Floats = np.sqrt(np.maximum(averaged.max(axis=-1), 0.0))
    return peak


def _mean(record: Floats) -> Floats:
    mean: Floats = record.mean(axis=1)
    return mean
