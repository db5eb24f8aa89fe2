"""Slow motion of the flap in still water: its buoyant spring rate, by the load cell.

    T = C (theta - theta0) + f sign(v) + b v + J a + z t

Two periods of motion separate spring and inertia, which cannot be separated in one sine. z t is a
drift of the cell's zero. Intervals are by leaving out one set point (or one period, if there are
few set points) at a time.
"""

from typing import NamedTuple

import numpy as np

from rig.kinds.oswec_bench.products.estimate import (
    CELL_UNCERTAINTY,
    Estimate,
    Floats,
    jackknife,
    with_floor,
)
from rig.kinds.oswec_bench.products.losses import MIN_GROUPS


class MovingSamples(NamedTuple):
    """A group of samples at which the flap moves, (samples,)."""

    angle: Floats  # rad
    velocity: Floats  # rad/s
    acceleration: Floats  # rad/s^2
    torque: Floats  # N*m, of the load cell
    time: Floats  # s since the tare


class SpringFit(NamedTuple):
    """Results of the load cell for the flap behind it."""

    stiffness: Estimate  # N*m/rad
    rest_angle: Estimate  # rad, angle of zero moment
    dry_friction: Estimate  # N*m
    viscous: Estimate  # N*m*s/rad
    inertia: Estimate  # kg*m^2, with added inertia of slow motion
    drift: Estimate  # N*m/s


def fit_spring(groups: list[MovingSamples], group_name: str) -> SpringFit:
    """Fit all groups; ``group_name`` names the groups. ValueError for too few of them."""
    if len(groups) < MIN_GROUPS:
        raise ValueError(f"{len(groups)} {group_name}; a spring needs at least {MIN_GROUPS}")
    designs = [_design_matrix(each) for each in groups]
    scale = np.sqrt(sum((x * x).sum(axis=0) for x in designs))
    grams = np.array([(x / scale).T @ (x / scale) for x in designs])
    right_sides = np.array([(x / scale).T @ g.torque for x, g in zip(designs, groups, strict=True)])
    gram, right = grams.sum(axis=0), right_sides.sum(axis=0)
    values = _spring_quantities(np.linalg.solve(gram, right) / scale)
    leave_one_out = np.array([
        _spring_quantities(np.linalg.solve(gram - g, right - r) / scale)
        for g, r in zip(grams, right_sides, strict=True)
    ])  # fmt: skip
    half_widths = jackknife(values, leave_one_out)
    units = ("N*m/rad", "rad", "N*m", "N*m*s/rad", "kg*m^2", "N*m/s")
    method = f"least squares, jackknife over {len(groups)} {group_name}"
    estimates = [
        Estimate(float(v), float(h), u, method)
        for v, h, u in zip(values, half_widths, units, strict=True)
    ]
    return SpringFit(with_floor(estimates[0], CELL_UNCERTAINTY), *estimates[1:])


def _design_matrix(samples: MovingSamples) -> Floats:
    v = samples.velocity
    columns = [samples.angle, np.ones(len(v)), np.sign(v), v, samples.acceleration, samples.time]
    return np.stack(columns, axis=1)


def _spring_quantities(coefficients: Floats) -> Floats:
    """Return stiffness to drift, in the order of `SpringFit`."""
    stiffness, offset, dry, viscous, inertia, drift = coefficients
    return np.array([stiffness, -offset / stiffness, dry, viscous, inertia, drift])
