"""Least squares that is linear but for one parameter, which is searched on a grid.

What each independent group (a set point) adds to the normal equations is kept apart, so that to
leave a group out costs nothing and the intervals of all parameters come from the scatter between
groups (jackknife), the searched one among them.
"""

from typing import NamedTuple

import numpy as np

from rig.analysis.session.estimate import Floats

_SINGULAR = 1e-9  # of normal equations scaled to ones


class Sums(NamedTuple):
    """Normal equations of one group by grid point."""

    gram: Floats  # (grid, unknowns, unknowns)
    right: Floats  # (grid, unknowns)
    square: float  # weighted sum of the squares of the values


class Searched(NamedTuple):
    """Parameters, the searched one last."""

    whole: Floats  # (unknowns + 1,)
    left_out: Floats  # (groups, unknowns + 1), each without one group
    remainder: float  # weighted sum of squares that is left


def sums(design: Floats, values: Floats, weight: Floats | None = None) -> Sums:
    """A group's ``design`` (grid, samples, unknowns) and ``values`` (samples,)."""
    weighted = design if weight is None else design * weight[None, :, None]
    squares = values * values if weight is None else weight * values * values
    return Sums(
        np.matmul(weighted.transpose(0, 2, 1), design),
        np.matmul(weighted.transpose(0, 2, 1), values),
        float(squares.sum()),
    )


def search(groups: list[Sums], grid: Floats) -> Searched:
    """The best parameters of all groups together, and without each of them."""
    gram = np.sum([each.gram for each in groups], axis=0)
    right = np.sum([each.right for each in groups], axis=0)
    square = float(sum(each.square for each in groups))
    whole, left = _solved(gram, right, square, grid)
    others = [
        _solved(gram - each.gram, right - each.right, square - each.square, grid)[0]
        for each in groups
    ]
    return Searched(whole, np.array(others), left)


def _solved(gram: Floats, right: Floats, square: float, grid: Floats) -> tuple[Floats, float]:
    scale = np.sqrt(np.einsum("kii->ki", gram))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(gram / (scale[:, :, None] * scale[:, None, :]))
    known = values[:, 0] > _SINGULAR  # else the data do not reach to this grid point
    along = np.einsum("kij,ki->kj", vectors, right / scale) / np.where(known[:, None], values, 1.0)
    found = np.einsum("kij,kj->ki", vectors, along) / scale
    left = np.where(known, square - np.einsum("ki,ki->k", right, found), np.inf)
    best = int(np.argmin(left))
    at = float(grid[best])
    if 0 < best < len(grid) - 1 and np.isfinite(left[best - 1 : best + 2]).all():
        at = _lowest(grid[best - 1 : best + 2], left[best - 1 : best + 2])
    here = [np.interp(at, grid[known], found[known, i]) for i in range(found.shape[1])]
    return np.array([*here, at]), float(left[best])


def _lowest(x: Floats, y: Floats) -> float:
    """Where the parabola through three points is lowest."""
    near, far = (x[1] - x[0]) * (y[1] - y[2]), (x[1] - x[2]) * (y[1] - y[0])
    if near == far:
        return float(x[1])
    off = 0.5 * ((x[1] - x[0]) * near - (x[1] - x[2]) * far) / (near - far)
    return float(np.clip(x[1] - off, x[0], x[2]))
