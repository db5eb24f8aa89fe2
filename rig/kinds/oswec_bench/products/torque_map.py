"""The deflection as a piecewise linear function of torque: half gap, soft zone, stiffness.

Figure 2.9 of the OSWEC thesis. In the direction of motion, with the teeth in contact,

    deflection = half gap + soft zone * min(T / knee, 1) + T / stiffness,

where T > 0 is the load cell's torque. The instantaneous position correction is this map; gap and
stiffness are results in their own right. The model is linear except for the knee, which is
searched.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from rig.kinds.oswec_bench.products import estimate
from rig.kinds.oswec_bench.products.deflection import Motion, engaged
from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, jackknifed

KNEES = np.concatenate([np.arange(3.0, 20.0, 0.25), np.arange(20.0, 40.0, 1.0)])  # N*m
BINS = 24  # bins of torque per direction and set point
MIN_BIN_SAMPLES = 4  # samples in a bin


class TorqueMap(NamedTuple):
    """Parameters of the map, each with its interval by the scatter between set points."""

    half_gap: Estimate  # rad
    soft_zone: Estimate  # rad
    knee: Estimate  # N*m
    stiffness: Estimate  # N*m/rad
    residual: float  # rad, rms


class BinnedDeflection(NamedTuple):
    """A set point's deflection by torque, both directions combined; means of bins."""

    torque: Floats  # N*m, > 0
    deflection: Floats  # rad, in the direction of the torque
    weight: Floats  # samples in the bin


def bin_deflection(motion: Motion) -> BinnedDeflection:
    """Return mean deflection and torque in bins of a set point's torque.

    Each is half the difference of both directions, which cancels an offset of the zeros.
    """
    in_contact = engaged(motion)
    directions = []
    for sign in (1.0, -1.0):
        side = in_contact & (sign * motion.torque > 0.0)
        directions.append((sign * motion.torque[side], sign * motion.deflection[side]))
    if min(len(torque) for torque, _ in directions) == 0:
        return BinnedDeflection(np.empty(0), np.empty(0), np.empty(0))
    max_torque = min(np.percentile(torque, 99.5) for torque, _ in directions)
    edges = np.linspace(0.0, max_torque, BINS + 1)
    rows = []
    for low, high in pairwise(edges):
        inside = [(x >= low) & (x < high) for x, _ in directions]
        if min(int(i.sum()) for i in inside) >= MIN_BIN_SAMPLES:
            pairs = zip(directions, inside, strict=True)
            sides = [(x[i].mean(), y[i].mean()) for (x, y), i in pairs]
            count = float(sum(i.sum() for i in inside))
            rows.append((*np.mean(sides, axis=0), count))
    columns = np.array(rows, np.float64).reshape(-1, 3).T
    return BinnedDeflection(*columns)


def _normal_equations(point: BinnedDeflection) -> estimate.NormalEquations:
    torque, deflection, weight = point
    ramp = np.minimum(torque[None, :] / KNEES[:, None], 1.0)
    ones = np.ones_like(ramp)
    return estimate.normal_equations(
        np.stack([ones, ramp, torque * ones], axis=2), deflection, weight
    )


def _map_parameters(parameters: Floats) -> Floats:
    """Return half gap, soft zone, knee, stiffness."""
    gap, soft, compliance, knee = parameters
    return np.array([gap, soft, knee, 1.0 / compliance])


def fit_map(points: list[BinnedDeflection]) -> TorqueMap:
    """Return the map through several set points; ValueError if fewer than three carry torque."""
    points = [each for each in points if len(each.torque) >= 4]
    if len(points) < 3:
        raise ValueError(f"{len(points)} set points under load; a map needs at least 3")
    searched = estimate.search_grid([_normal_equations(each) for each in points], KNEES)
    values = _map_parameters(searched.parameters)
    left_out = [_map_parameters(each) for each in searched.leave_one_out]
    method = f"map of {len(points)} set points, jackknife over them"
    units = ("rad", "rad", "N*m", "N*m/rad")
    gap, soft, knee, stiffness = jackknifed(values, left_out, units, method)
    weight = sum(float(each.weight.sum()) for each in points)
    return TorqueMap(
        gap,
        soft,
        knee.with_cell_error(),
        stiffness.with_cell_error(),
        float(np.sqrt(max(0.0, searched.residual_squares) / weight)),
    )


def map_deflection(torque_map: TorqueMap, torque: Floats) -> Floats:
    """Return the map's deflection at a torque of either sign, rad; its sign is the torque's."""
    magnitude = np.abs(torque)
    deflection = (
        torque_map.half_gap.value
        + torque_map.soft_zone.value * np.minimum(magnitude / torque_map.knee.value, 1.0)
        + magnitude / torque_map.stiffness.value
    )
    return np.sign(torque) * deflection
