"""A result of a session: a value with the half width of its 95 % interval.

Samples of one run are not independent of each other, so no interval is based on their number. Each
interval is based on the scatter between oscillations, set points or runs, as the functions state.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.stats import t as student

Floats = npt.NDArray[np.float64]

CONFIDENCE = 0.95
"""Probability of all intervals."""

CELL_UNCERTAINTY = 0.001
"""Relative uncertainty of a torque due to cross-talk of a six-axis load cell.

Repeated readings do not reduce it: no result that is proportional to the torque claims a smaller
one.
"""


class Estimate(NamedTuple):
    """A quantity with its uncertainty."""

    value: float
    uncertainty: float  # half width of the 95 % interval; NaN if unknown
    unit: str
    method: str  # short description, with the basis of the interval

    def covers(self, truth: float) -> bool:
        """Return whether a value lies within the interval."""
        return abs(truth - self.value) <= self.uncertainty


def coverage_factor(degrees_of_freedom: float) -> float:
    """Return the half width of a 95 % interval in standard errors.

    The result is NaN without degrees of freedom.
    """
    return (
        float(student.ppf(0.5 + 0.5 * CONFIDENCE, degrees_of_freedom))
        if degrees_of_freedom > 0
        else float("nan")
    )


def mean(values: Any, unit: str, method: str) -> Estimate:
    """Return the mean of equally accurate and independent values; values that are not finite are
    ignored.
    """
    samples = np.asarray(values, np.float64)
    samples = samples[np.isfinite(samples)]
    if len(samples) == 0:
        return Estimate(float("nan"), float("nan"), unit, method)
    error = np.std(samples, ddof=1) / np.sqrt(len(samples)) if len(samples) > 1 else np.nan
    return Estimate(
        float(samples.mean()), float(coverage_factor(len(samples) - 1) * error), unit, method
    )


def with_floor(estimate: Estimate, share: float) -> Estimate:
    """Return the estimate, its interval widened in quadrature by a share of its value.

    The share stands for an error that no scatter reveals.
    """
    return estimate._replace(
        uncertainty=float(np.hypot(estimate.uncertainty, share * estimate.value))
    )


def jackknife(estimates: Floats, left_out: Floats) -> Floats:
    """Return half widths of estimates, from the same estimates with one independent group left out
    each.

    ``estimates`` (n,), ``left_out`` (groups, n). Efron & Stein (1981), Student's t with groups - 1.
    """
    group_count = len(left_out)
    if group_count < 2:
        return np.full(np.shape(estimates), np.nan)
    deviations = left_out - left_out.mean(axis=0)
    half_widths: Floats = coverage_factor(group_count - 1) * np.sqrt(
        (group_count - 1) / group_count * (deviations * deviations).sum(axis=0)
    )
    return half_widths
