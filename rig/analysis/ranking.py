"""Points that cannot be distinguished from the best one, by the errors of their mean powers.

Two points that were measured in the same seas are compared sea by sea: the differences between seas
are larger than those between points, and cancel. Without several seeds, the errors of both points
count (Welch's test). A difference is significant if its two-sided 95 % interval by Student's
distribution is without zero.
"""

from collections.abc import Iterable

import numpy as np
from scipy.special import stdtrit

from rig.analysis.points import Point
from rig.analysis.rows import standard_error

CONFIDENCE = 0.95


def half_width(error: float, dof: float) -> float:
    """Return the half width of Student's interval; NaN without a degree of freedom."""
    if not dof > 0.0:
        return float("nan")
    return float(stdtrit(dof, 0.5 + 0.5 * CONFIDENCE) * error)


def difference(point: Point, best: Point, name: str) -> tuple[float, float]:
    """Return how much less a point absorbs than another (W), and the half width of its interval.

    The half width is NaN where an error is unknown.
    """
    seeds = sorted(point.by_seed.keys() & best.by_seed.keys())
    if len(seeds) > 1:
        pairs = np.array([point.by_seed[s][name] - best.by_seed[s][name] for s in seeds])
        return float(pairs.mean()), half_width(standard_error(pairs), len(pairs) - 1)
    variances = np.array([each.error[name] ** 2 for each in (point, best)])
    dofs = np.array([each.dof.get(name, np.inf) for each in (point, best)])
    watts, variance = point.power[name] - best.power[name], float(variances.sum())
    if not np.isfinite(variance) or not (dofs > 0).all():
        return watts, float("nan")
    if variance == 0.0:
        return watts, 0.0
    spread = float(np.sum(variances**2 / dofs))
    return watts, half_width(np.sqrt(variance), variance**2 / spread if spread else np.inf)


def not_worse(points: Iterable[Point], best: Point, name: str) -> tuple[Point, ...] | None:
    """Return the other points that cannot be distinguished from the best one, the best one first.

    None if the error of one of the points is unknown: then the best point is not certain.
    """
    alike = []
    for point in points:
        if point is best:
            continue
        watts, half = difference(point, best, name)
        if not np.isfinite(half):
            return None
        if watts <= half:
            alike.append(point)
    return tuple(sorted(alike, key=lambda point: point.power[name]))
