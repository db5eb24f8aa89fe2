"""Points that cannot be distinguished from the best one, by the errors of their mean powers.

Two points that were measured in the same seas are compared sea by sea: the differences between seas
are larger than those between points, and cancel. Without several seeds, the errors of both points
count (Welch's test). The mean of several seas is no better known than the windows of rows that
ended early. Errors of a budget (Type B) are the same in all rows of a run: of each source, the
difference has the difference of its signed contributions, which for equal powers is almost zero
(the covariance term of the GUM, 5.2.2). A difference is significant if its two-sided 95 % interval
is without zero.
"""

from collections.abc import Iterable

import numpy as np

from rig.analysis.intervals import combined_half_width
from rig.analysis.points import Point
from rig.analysis.scatter import NO_ERROR, MeanError, error_of_sum, standard_error


def difference(point: Point, best: Point, name: str) -> tuple[float, float]:
    """Return how much less a point absorbs than another (W), and the half width of its interval.

    The half width is NaN where an error is unknown.
    """
    seeds = sorted(point.by_seed.keys() & best.by_seed.keys())
    if len(seeds) > 1:
        pairs = np.array([point.by_seed[s][name] - best.by_seed[s][name] for s in seeds])
        shares = point.contributions(name, seeds) - best.contributions(name, seeds)
        windows = error_of_sum(p.window_error.get(name, NO_ERROR) for p in (point, best))
        seas = MeanError(standard_error(pairs), len(pairs) - 1.0)
        error, dof = max(seas, windows, key=lambda each: each.error)
        return float(pairs.mean()), combined_half_width(error, dof, shares, point.distributions)
    watts = point.power[name] - best.power[name]
    error, dof = error_of_sum(
        MeanError(each.error[name], each.dof.get(name, np.inf))
        for each in (point, best)
        # The error of a row compared with the reference row is that of their difference.
        if not (each.is_reference and (point.is_compared or best.is_compared))
    )
    shares = point.contributions(name) - best.contributions(name)
    return watts, combined_half_width(error, dof, shares, point.distributions)


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
