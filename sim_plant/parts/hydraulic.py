"""Hydraulic PTO: cylinder, check valves, gas accumulator, motor with generator. Pure.

The cylinder pumps oil in both directions through four check valves into the high-pressure line,
where an accumulator stores it; a hydraulic motor of fixed displacement takes it back to the
low-pressure line and turns a generator:

    F = -A (p - p_low) tanh(v / v_c)              on the axis
    V' = D w + k (p - p_low) - A v tanh(v / v_c)  gas volume
    p = p_0 (V_0 / V)^n                           the gas changes its state polytropically
    J w' = D (p - p_low) - B w - Kt |i| tanh(w / w_c)

The generator's current brakes the motor whatever its sign. In steady motion F = (A / D) Kt |i| and
losses: the accumulator apart, A / D is a gear ratio. Inflow and force have the same factor tanh, so
that the power that leaves the axis is the power that enters the oil. Source: R. So, A. Simmons,
T. Brekken, K. Ruehl, C. Michelen, Development of PTO-Sim, OMAE 2015-42074 (check-valve PTO).
"""

from __future__ import annotations

import math
from typing import NamedTuple

from sim_plant.units import MetrePerSecond, Newton, NewtonMetre, RadianPerSecond

COMPLIANCE = 0.02  # of line and oil between precharge and low pressure, by the gas volume V_0
STANDSTILL = 5.0  # rad/s, width in which the generator's torque vanishes at a standing shaft


class HydraulicParams(NamedTuple):
    """Constants of cylinder, oil, gas and motor."""

    area: float  # m2, of the piston
    displacement: float  # m3/rad, of the motor
    low_pressure: float  # Pa, held by the low-pressure side
    precharge: float  # Pa, p_0 of the gas without oil
    volume: float  # m3, V_0
    least_volume: float  # m3, at which the relief valve opens
    exponent: float  # n
    leakage: float  # m3/s per Pa, between the two lines
    inertia: float  # kg m2, of motor and generator
    viscous: float  # N m s/rad
    valve_width: MetrePerSecond  # v_c, in which the valves change over


def pressure(params: HydraulicParams, volume: float) -> float:
    """Return the pressure of the high-pressure line (Pa) at a gas volume (m3).

    Once the gas has filled V_0, the compliance of line and oil takes the pressure down to that of
    the other line.
    """
    if not volume > 0.0:
        return params.precharge
    if volume < params.volume:
        return params.precharge * math.exp(params.exponent * math.log(params.volume / volume))
    missing = (volume - params.volume) / (COMPLIANCE * params.volume)
    return params.precharge + (params.low_pressure - params.precharge) * min(missing, 1.0)


def volume_at(params: HydraulicParams, pressure: float) -> float:
    """Return the gas volume (m3) at a pressure of the high-pressure line (Pa)."""
    if not pressure > params.precharge:
        return params.volume
    return params.volume * math.exp(-math.log(pressure / params.precharge) / params.exponent)


def cylinder_force(params: HydraulicParams, pressure: float, velocity: MetrePerSecond) -> Newton:
    """Return the force on the axis."""
    difference = pressure - params.low_pressure
    return -params.area * difference * math.tanh(velocity / params.valve_width)


def volume_rate(
    params: HydraulicParams, volume: float, velocity: MetrePerSecond, speed: RadianPerSecond
) -> float:
    """Return the rate of the gas volume, m3/s: positive while oil leaves the accumulator.

    An empty accumulator gives no oil; then the motor runs partly dry. A full one takes none: the
    relief valve lets it go to the low-pressure side.
    """
    inflow = params.area * velocity * math.tanh(velocity / params.valve_width)
    difference = pressure(params, volume) - params.low_pressure
    rate = params.displacement * speed + params.leakage * difference - inflow
    if not volume < (1.0 + COMPLIANCE) * params.volume:
        return min(rate, 0.0)
    if not volume > params.least_volume:
        return max(rate, 0.0)
    return rate


def brake_torque(motor_torque: NewtonMetre, speed: RadianPerSecond) -> NewtonMetre:
    """Return the generator's torque against the rotation, for Kt i of either sign."""
    return abs(motor_torque) * math.tanh(speed / STANDSTILL)


def acceleration(
    params: HydraulicParams, pressure: float, speed: RadianPerSecond, brake: NewtonMetre
) -> float:
    """Return the motor's acceleration, rad/s2."""
    drive = params.displacement * (pressure - params.low_pressure)
    return (drive - params.viscous * speed - brake) / params.inertia
