"""Minimum of a function with one valley, evaluated at many points at a time.

Each iteration fits a quadratic to a few points around the best one, tries the minimum of the
quadratic, and reduces the distance of the points. The quadratic has cross terms, so a narrow or
inclined valley does not slow the descent down.
"""

from collections.abc import Callable

import numpy as np

from rig.spectra.periods import Floats

Costs = Callable[[Floats], Floats]
"""Costs of points (points by coordinates)."""

SHRINK = 0.55  # factor on the distance of the points per iteration


def descend(
    costs: Costs,
    start: Floats,
    steps: Floats,
    iterations: int,
    project: Callable[[Floats], Floats],
) -> Floats:
    """Return the point with the lowest cost found from ``start``.

    ``steps`` is the initial distance of the points in each coordinate; a coordinate with step 0 is
    fixed. ``project`` moves a point into the allowed space.
    """
    free = np.flatnonzero(steps > 0.0)
    offsets = np.zeros((1 + 2 * free.size + 2**free.size, len(steps)))
    offsets[:, free] = _design_points(free.size)
    offsets = np.unique(offsets, axis=0)
    best, lowest = project(start), np.inf
    for _ in range(iterations):
        centre = best
        points = np.array([project(centre + offset * steps) for offset in offsets])
        values = costs(points)
        minimum = np.zeros(len(steps))
        minimum[free] = _quadratic_minimum(offsets[:, free], values)
        tried = np.array([project(centre + minimum * steps)])
        points, values = np.concatenate([points, tried]), np.append(values, costs(tried))
        index = int(np.argmin(values))
        if values[index] < lowest:
            best, lowest = points[index], float(values[index])
        steps = steps * SHRINK
    return best


def _design_points(dimensions: int) -> Floats:
    """Return centre, axis ends and corners, in units of a step."""
    corners = np.stack(np.meshgrid(*[[-1.0, 1.0]] * dimensions, indexing="ij"), axis=-1)
    ends = np.concatenate([np.eye(dimensions), -np.eye(dimensions)])
    return np.concatenate([np.zeros((1, dimensions)), ends, corners.reshape(-1, dimensions)])


def _quadratic_minimum(points: Floats, costs: Floats) -> Floats:
    """Return the minimum of the fitted quadratic, within two steps."""
    from scipy.optimize import minimize  # noqa: PLC0415 - the import takes 0.3 s

    dimensions = points.shape[1]
    rows, columns = np.triu_indices(dimensions)

    def terms(x: Floats) -> Floats:
        return np.concatenate(
            [np.ones((*x.shape[:-1], 1)), x, x[..., rows] * x[..., columns]], axis=-1
        )

    coefficients = np.linalg.lstsq(terms(points), costs, rcond=None)[0]
    result = minimize(
        lambda x: float(terms(np.asarray(x)) @ coefficients),
        np.zeros(dimensions),
        bounds=[(-2.0, 2.0)] * dimensions,
    )
    return np.asarray(result.x, dtype=np.float64)
