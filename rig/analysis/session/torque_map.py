"""The deflection as a piecewise linear function of torque: half gap, soft zone, stiffness.

Figure 2.9 of the OSWEC thesis. In the direction of motion, with the teeth in contact,

    deflection = half gap + soft zone * min(T / knee, 1) + T / stiffness,

T > 0 the load cell's torque. The instantaneous position correction is this map; gap and stiffness
are results of their own. The model is linear but for the knee, which is searched.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rig.analysis.session.deflection import Motion, engaged
from rig.analysis.session.estimate import CELL, Estimate, Floats, jackknife, with_floor
from rig.analysis.session.separable_fit import Sums, search, sums

KNEES = np.concatenate([np.arange(3.0, 20.0, 0.25), np.arange(20.0, 40.0, 1.0)])  # N*m
BINS = 24  # of torque, a direction and set point
_LEAST = 4  # samples in a bin that counts


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


def _group(point: Loaded) -> Sums:
    torque, bent, weight = point
    ramp = np.minimum(torque[None, :] / KNEES[:, None], 1.0)
    one = np.ones_like(ramp)
    return sums(np.stack([one, ramp, torque * one], axis=2), bent, weight)


def _named(found: Floats) -> Floats:
    """Half gap, soft zone, knee, stiffness."""
    gap, soft, compliance, knee = found
    return np.array([gap, soft, knee, 1.0 / compliance])


def fit(points: list[Loaded]) -> TorqueMap:
    """The map through several set points; ValueError if there are fewer than three with torque."""
    points = [each for each in points if len(each.torque) >= 4]
    if len(points) < 3:
        raise ValueError(f"{len(points)} set points under load; a map needs at least 3")
    found = search([_group(each) for each in points], KNEES)
    whole = _named(found.whole)
    half = jackknife(whole, np.array([_named(each) for each in found.left_out]))
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
        with_floor(knee, CELL),
        with_floor(stiffness, CELL),
        1.0 - found.remainder / float((weight * off * off).sum()),
        float(np.sqrt(max(0.0, found.remainder) / weight.sum())),
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
