"""The flap turned slowly in still water: its buoyant spring, by the load cell.

    T = C (theta - theta0) + f sign(v) + b v + J a + z t

Two periods of motion tell spring and inertia apart, which in one sine are the same. z t is a drift
of the cell's zero. Intervals by leaving out one set point (or period, where there are few) at a
time.
"""

from typing import NamedTuple

import numpy as np

from rig.analysis.session.estimate import CELL, Estimate, Floats, jackknife, with_floor
from rig.analysis.session.losses import LEAST_GROUPS


class Turned(NamedTuple):
    """A group of samples at which the flap turns, (samples,)."""

    angle: Floats  # rad
    velocity: Floats  # rad/s
    acceleration: Floats  # rad/s^2
    torque: Floats  # N*m, of the load cell
    time: Floats  # s since the tare


class Spring(NamedTuple):
    """What the cell says of the flap behind it."""

    stiffness: Estimate  # N*m/rad
    rest: Estimate  # rad, where the moment is nothing
    dry: Estimate  # N*m
    viscous: Estimate  # N*m*s/rad
    inertia: Estimate  # kg*m^2, with added inertia of slow motion
    drift: Estimate  # N*m/s


def spring(groups: list[Turned], kind: str) -> Spring:
    """Fit all groups; ``kind`` says what a group is. ValueError for too few of them."""
    if len(groups) < LEAST_GROUPS:
        raise ValueError(f"{len(groups)} {kind}; a spring needs at least {LEAST_GROUPS}")
    designs = [_design(each) for each in groups]
    scale = np.sqrt(sum((x * x).sum(axis=0) for x in designs))
    grams = np.array([(x / scale).T @ (x / scale) for x in designs])
    rights = np.array([(x / scale).T @ g.torque for x, g in zip(designs, groups, strict=True)])
    gram, right = grams.sum(axis=0), rights.sum(axis=0)
    whole = _told(np.linalg.solve(gram, right) / scale)
    fewer = np.array([
        _told(np.linalg.solve(gram - g, right - r) / scale)
        for g, r in zip(grams, rights, strict=True)
    ])  # fmt: skip
    half = jackknife(whole, fewer)
    units = ("N*m/rad", "rad", "N*m", "N*m*s/rad", "kg*m^2", "N*m/s")
    how = f"least squares, jackknife over {len(groups)} {kind}"
    found = [
        Estimate(float(v), float(h), u, how) for v, h, u in zip(whole, half, units, strict=True)
    ]
    return Spring(with_floor(found[0], CELL), *found[1:])


def _design(of: Turned) -> Floats:
    v = of.velocity
    columns = [of.angle, np.ones(len(v)), np.sign(v), v, of.acceleration, of.time]
    return np.stack(columns, axis=1)


def _told(found: Floats) -> Floats:
    """In the order of `Spring`."""
    stiffness, level, dry, viscous, inertia, drift = found
    return np.array([stiffness, -level / stiffness, dry, viscous, inertia, drift])
