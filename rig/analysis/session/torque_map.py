"""The deflection as a piecewise linear function of torque: half gap, soft zone, stiffness.

Figure 2.9 of the OSWEC thesis. In the direction of motion, with the teeth in contact,

    deflection = half gap + soft zone * min(T / knee, 1) + T / stiffness,

T > 0 the load cell's torque. The instantaneous position correction is this map; gap and stiffness
are results of their own. The model is linear but for the knee, which is searched on a grid; what
one set point adds to the normal equations is kept apart, so that leaving it out costs nothing.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rig.analysis.session.deflection import Motion, engaged
from rig.analysis.session.estimate import Estimate, Floats, jackknife

KNEES = np.concatenate([np.arange(3.0, 20.0, 0.25), np.arange(20.0, 40.0, 1.0)])  # N*m
BINS = 24  # of torque, a direction and set point
_LEAST = 4  # samples in a bin that counts
_SINGULAR = 1e-9  # of normal equations scaled to ones


class TorqueMap(NamedTuple):
    """The map's parameters, each with its interval by the scatter between set points."""

    half_gap: Estimate  # rad
    soft_zone: Estimate  # rad
    knee: Estimate  # N*m
    stiffness: Estimate  # N*m/rad
    r_squared: float
    residual: float  # rad, rms


class Loaded(NamedTuple):
    """A set point's deflection by torque, both directions in one; means of bins."""

    torque: Floats  # N*m, > 0
    deflection: Floats  # rad, in the direction of the torque
    weight: Floats  # samples in the bin


def loaded(of: Motion) -> Loaded:
    """Bins of a set point's torque, with the mean deflection and torque in each.

    Half the difference of both directions: an offset of the zeros goes out of it.
    """
    there = engaged(of)
    found = []
    for sign in (1.0, -1.0):
        side = there & (sign * of.torque > 0.0)
        found.append((sign * of.torque[side], sign * of.deflection[side]))
    if min(len(torque) for torque, _ in found) == 0:
        return Loaded(np.empty(0), np.empty(0), np.empty(0))
    top = min(np.percentile(torque, 99.5) for torque, _ in found)
    edges = np.linspace(0.0, top, BINS + 1)
    rows = []
    for low, high in pairwise(edges):
        inside = [(x >= low) & (x < high) for x, _ in found]
        if min(int(i.sum()) for i in inside) >= _LEAST:
            torque = np.mean([x[i].mean() for (x, _), i in zip(found, inside, strict=True)])
            bent = np.mean([np.mean(y[i]) for (_, y), i in zip(found, inside, strict=True)])
            rows.append((torque, bent, float(sum(i.sum() for i in inside))))
    columns = np.array(rows, np.float64).reshape(-1, 3).T
    return Loaded(*columns)


class _Sums(NamedTuple):
    """Normal equations, by set point and knee."""

    gram: Floats  # (points, knees, 3, 3)
    right: Floats  # (points, knees, 3)
    square: Floats  # (points,) weighted sum of y^2


def _sums(points: list[Loaded]) -> _Sums:
    gram, right, square = [], [], []
    for torque, bent, weight in points:
        ramp = np.minimum(torque[None, :] / KNEES[:, None], 1.0)
        one = np.ones_like(ramp)
        design = np.stack([one, ramp, torque * one], axis=2)  # (knees, bins, 3)
        weighted = design * weight[None, :, None]
        gram.append(np.einsum("kni,knj->kij", weighted, design))
        right.append(np.einsum("kni,n->ki", weighted, bent))
        square.append(float((weight * bent * bent).sum()))
    return _Sums(np.array(gram), np.array(right), np.array(square))


def _solved(gram: Floats, right: Floats, square: float) -> tuple[Floats, float]:
    """Half gap, soft zone, knee, stiffness; and the weighted sum of squares that is left."""
    scale = np.sqrt(np.einsum("kii->ki", gram))
    scaled = gram / (scale[:, :, None] * scale[:, None, :])
    values, vectors = np.linalg.eigh(scaled)
    known = values[:, 0] > _SINGULAR  # else no bin lies below this knee
    along = np.einsum("kij,ki->kj", vectors, right / scale) / np.where(known[:, None], values, 1.0)
    found = np.einsum("kij,kj->ki", vectors, along) / scale
    left = np.where(known, square - np.einsum("ki,ki->k", right, found), np.inf)
    best = int(np.argmin(left))
    knee = KNEES[best]
    if 0 < best < len(KNEES) - 1 and np.isfinite(
        left[best - 1]
    ):  # between grid points, by the parabola of three
        a, b, c = left[best - 1 : best + 2]
        x, y, z = KNEES[best - 1 : best + 2]
        top = (x * x - y * y) * (b - c) - (y * y - z * z) * (a - b)
        below = (x - y) * (b - c) - (y - z) * (a - b)
        knee = float(np.clip(0.5 * top / below, x, z)) if below else knee
    here = np.array([np.interp(knee, KNEES, found[:, i]) for i in range(3)])
    return np.array([here[0], here[1], knee, 1.0 / here[2]]), float(left[best])


def fit(points: list[Loaded]) -> TorqueMap:
    """The map through several set points; ValueError if there are fewer than three with torque."""
    points = [each for each in points if len(each.torque) >= 4]
    if len(points) < 3:
        raise ValueError(f"{len(points)} set points under load; a map needs at least 3")
    sums = _sums(points)
    whole, left = _solved(sums.gram.sum(0), sums.right.sum(0), float(sums.square.sum()))
    others = [
        _solved(
            sums.gram.sum(0) - sums.gram[i],
            sums.right.sum(0) - sums.right[i],
            float(sums.square.sum() - sums.square[i]),
        )[0]
        for i in range(len(points))
    ]
    half = jackknife(whole, np.array(others))
    bent = np.concatenate([each.deflection for each in points])
    weight = np.concatenate([each.weight for each in points])
    off = bent - np.average(bent, weights=weight)
    how = f"map of {len(points)} set points, jackknife over them"
    units = ("rad", "rad", "N*m", "N*m/rad")
    gap, soft, knee, stiffness = (
        Estimate(float(value), float(width), unit, how)
        for value, width, unit in zip(whole, half, units, strict=True)
    )
    return TorqueMap(
        gap,
        soft,
        knee,
        stiffness,
        1.0 - left / float((weight * off * off).sum()),
        float(np.sqrt(max(0.0, left) / weight.sum())),
    )


def deflection(known: TorqueMap, torque: Floats) -> Floats:
    """The map's deflection at a torque of either sign, rad; the gap has torque's sign."""
    size = np.abs(torque)
    bent = (
        known.half_gap.value
        + known.soft_zone.value * np.minimum(size / known.knee.value, 1.0)
        + size / known.stiffness.value
    )
    out: Floats = np.sign(torque) * bent
    return out
