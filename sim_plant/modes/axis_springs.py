"""Conversion of the springs of a plant file: numbers of the step, stiffness at the axes."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from sim_plant.magnetic_spring import Table, fit_slope, rate_at, slope_at
from sim_plant.modes.bem_content import Floats
from sim_plant.modes.parameters import MagneticSpring, Plant, Spring
from sim_plant.modes.springs import NO_AXIS, SPRING_PARAM_COUNT, StatorParams
from sim_plant.parts.spring import MagneticParams, SpringParams

Rates = tuple[list[float], list[float]]
"""Stator positions and rates."""


def stiffness(plant: Plant) -> Floats:
    """Return the stiffness of the springs for small motions from rest, (axes, axes)."""
    total = _linear(plant)
    for a, b, given, (positions, rates) in _magnetic(plant):
        table, at = Table(0, 0, len(rates) - 1), given.stator_position or 0.0
        rate, slope = (f(positions, rates, table, at) for f in (rate_at, slope_at))
        own = magnetic_params(given)
        total[a, a] += 2.0 * own.angle_per_metre**2 * own.peak_torque_per_rate * rate
        if b != NO_AXIS:
            gradient = own.peak_torque_per_rate * slope
            total[b, b] += own.pull * math.copysign(gradient, rate * gradient)
    return total


def largest_stiffness(plant: Plant) -> Floats:
    """Return a bound of the stiffness wherever axes and stators are, (axes, axes)."""
    bound = np.abs(_linear(plant))
    for a, b, given, (positions, rates) in _magnetic(plant):
        own = magnetic_params(given)
        peak = own.peak_torque_per_rate * np.abs(rates).max()
        bound[a, a] += 2.0 * own.angle_per_metre**2 * peak
        if b != NO_AXIS:
            gradient = own.peak_torque_per_rate * np.abs(np.diff(rates) / np.diff(positions)).max()
            bound[b, b] += own.pull * gradient
            bound[[a, b], [b, a]] += own.angle_per_metre * gradient
    return bound


def numbers(plant: Plant) -> list[float]:
    """Return the numbers of `springs.SPRING_PARTS` of each axis with springs, then all tables."""
    found: list[float] = []
    tables: list[float] = []
    axes, first = list(plant.axes), SPRING_PARAM_COUNT * len(plant.sprung_axes())
    magnetic = {a: (b, given, table) for a, b, given, table in _magnetic(plant)}
    for name in plant.sprung_axes():
        a = axes.index(name)
        own, stator = MagneticParams(1.0, 0.0, 0.0), StatorParams(NO_AXIS, 0.0, 0, 0)
        if a in magnetic:
            b, given, (positions, rates) = magnetic[a]
            own = magnetic_params(given)
            at = given.stator_position or 0.0
            stator = StatorParams(b, at, first + len(tables), len(positions))
            tables += [*positions, *rates]
        parts = (_linear_params(plant.axes[name].spring), own, stator)
        found += [float(a), *(float(number) for part in parts for number in part)]
    return found + tables


def magnetic_params(given: MagneticSpring) -> MagneticParams:
    """Return pinion and torque; rates of small motions are the slope 2 of sin 2 theta."""
    radius, half_angle = given.pinion_radius, given.fit_half_angle_rad
    slope = 2.0 if half_angle is None else fit_slope(half_angle)
    return MagneticParams(1.0 / radius, radius * radius / slope, given.pull)


def _linear(plant: Plant) -> Floats:
    return np.diag([axis.spring.rate if axis.spring else 0.0 for axis in plant.axes.values()])


def _magnetic(plant: Plant) -> Iterator[tuple[int, int, MagneticSpring, Rates]]:
    """Yield axis, axis of the stator or NO_AXIS, section and table of each magnetic spring."""
    axes = list(plant.axes)
    for a, axis in enumerate(plant.axes.values()):
        given = axis.magnetic_spring
        if given is None:
            continue
        table: Rates = ([0.0], [float(given.rate or 0.0)])  # of a fixed rate
        if given.stator_positions is not None and given.rates is not None:
            table = [float(z) for z in given.stator_positions], [float(k) for k in given.rates]
        yield a, NO_AXIS if given.stator is None else axes.index(given.stator), given, table


def _linear_params(given: Spring | None) -> SpringParams:
    if given is None:
        return SpringParams(0.0, 0.0)
    if given.preload is not None:
        return SpringParams(given.rate, given.preload)
    return SpringParams(given.rate, given.rate * (given.rest_position or 0.0))
