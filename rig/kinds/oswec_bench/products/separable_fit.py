"""Least squares that are linear except for one parameter, which is searched on a grid.

The contribution of each independent group (a set point) to the normal equations is stored
separately. So leaving out a group costs almost nothing, and the intervals of all parameters, the
searched one included, follow from the scatter between groups (jackknife).
"""

from typing import NamedTuple

import numpy as np

from rig.kinds.oswec_bench.products.estimate import Floats

_SINGULAR = 1e-9  # eigenvalue of normal equations with unit diagonal


class NormalEquations(NamedTuple):
    """Normal equations of one group by grid point."""

    gram: Floats  # (grid, unknowns, unknowns)
    right: Floats  # (grid, unknowns)
    value_squares: float  # weighted sum of the squares of the values


class SearchResult(NamedTuple):
    """Parameters; the searched one is the last."""

    parameters: Floats  # (unknowns + 1,)
    leave_one_out: Floats  # (groups, unknowns + 1), each without one group
    residual_squares: float  # weighted sum of squared residuals


def normal_equations(
    design: Floats, values: Floats, weight: Floats | None = None
) -> NormalEquations:
    """Return a group's sums from ``design`` (grid, samples, unknowns) and ``values`` (samples,)."""
    weighted = design if weight is None else design * weight[None, :, None]
    squares = values * values if weight is None else weight * values * values
    return NormalEquations(
        np.matmul(weighted.transpose(0, 2, 1), design),
        np.matmul(weighted.transpose(0, 2, 1), values),
        float(squares.sum()),
    )


def search_grid(groups: list[NormalEquations], grid: Floats) -> SearchResult:
    """Return the best parameters of all groups together, and without each of them."""
    gram = np.sum([each.gram for each in groups], axis=0)
    right = np.sum([each.right for each in groups], axis=0)
    value_squares = float(sum(each.value_squares for each in groups))
    parameters, residual_squares = _solve_grid(gram, right, value_squares, grid)
    leave_one_out = [
        _solve_grid(gram - each.gram, right - each.right, value_squares - each.value_squares, grid)[
            0
        ]
        for each in groups
    ]
    return SearchResult(parameters, np.array(leave_one_out), residual_squares)


def _solve_grid(
    gram: Floats, right: Floats, value_squares: float, grid: Floats
) -> tuple[Floats, float]:
    scale = np.sqrt(np.einsum("kii->ki", gram))
    scale = np.where(scale > 0.0, scale, 1.0)
    values, vectors = np.linalg.eigh(gram / (scale[:, :, None] * scale[:, None, :]))
    regular = values[:, 0] > _SINGULAR  # otherwise the data do not determine this grid point
    projected = np.einsum("kij,ki->kj", vectors, right / scale) / np.where(
        regular[:, None], values, 1.0
    )
    solutions = np.einsum("kij,kj->ki", vectors, projected) / scale
    residual_squares = np.where(
        regular, value_squares - np.einsum("ki,ki->k", right, solutions), np.inf
    )
    best = int(np.argmin(residual_squares))
    minimum = float(grid[best])
    if 0 < best < len(grid) - 1 and np.isfinite(residual_squares[best - 1 : best + 2]).all():
        minimum = _parabola_minimum(
            grid[best - 1 : best + 2], residual_squares[best - 1 : best + 2]
        )
    parameters = [
        np.interp(minimum, grid[regular], solutions[regular, i]) for i in range(solutions.shape[1])
    ]
    return np.array([*parameters, minimum]), float(residual_squares[best])


def _parabola_minimum(x: Floats, y: Floats) -> float:
    """Return the position of the minimum of the parabola through three points."""
    left_term, right_term = (x[1] - x[0]) * (y[1] - y[2]), (x[1] - x[2]) * (y[1] - y[0])
    if left_term == right_term:
        return float(x[1])
    offset = (
        0.5 * ((x[1] - x[0]) * left_term - (x[1] - x[2]) * right_term) / (left_term - right_term)
    )
    return float(np.clip(x[1] - offset, x[0], x[2]))
