"""Points that cannot be distinguished from the best one, by the errors of their mean powers.

Two points that were measured in the same seas are compared sea by sea: the differences between seas
are larger than those between points, and cancel. Without several seeds, the errors of both points
count (Welch's test). Errors of a budget (Type B) are the same in all rows of a run: of each source,
the difference has the difference of its signed contributions, which for equal powers is almost zero
(the covariance term of the GUM, 5.2.2). A difference is significant if its two-sided 95 % interval
is without zero.
"""

from collections.abc import Iterable

import numpy as np

from rig.analysis.intervals import combined_half_width
from rig.analysis.points import Point
from rig.analysis.scatter import standard_error


def difference(point: Point, best: Point, name: str) -> tuple[float, float]:
    """Return how much less a point absorbs than another (W), and the half width of its interval.

    The half width is NaN where an error is unknown.
    """
    seeds = sorted(point.by_seed.keys() & best.by_seed.keys())
    if len(seeds) > 1:
        pairs = np.array([point.by_seed[s][name] - best.by_seed[s][name] for s in seeds])
        shares = point.contributions(name, seeds) - best.contributions(name, seeds)
        error, dof = standard_error(pairs), len(pairs) - 1.0
        return float(pairs.mean()), combined_half_width(error, dof, shares, point.distributions)
    variances = np.array([each.error[name] ** 2 for each in (point, best)])
    dofs = np.array([each.dof.get(name, np.inf) for each in (point, best)])
    watts, variance = point.power[name] - best.power[name], float(variances.sum())
    if not np.isfinite(variance) or not (dofs > 0).all():
        return watts, float("nan")
    spread = float(np.sum(variances**2 / dofs))
    dof = variance**2 / spread if spread else np.inf
    shares = point.contributions(name) - best.contributions(name)
    return watts, combined_half_width(np.sqrt(variance), dof, shares, point.distributions)


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
