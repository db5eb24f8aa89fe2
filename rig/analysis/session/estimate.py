"""What a session says of a quantity: a value with the half width of its 95 % interval.

Samples of one run are not independent of each other, so no interval rests on their number: it
rests on the scatter between oscillations, set points or runs, as each function says.
"""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy.stats import t as student

Floats = npt.NDArray[np.float64]

SHARE = 0.95
"""Of all intervals."""

CELL = 0.001
"""Share of a torque that a six-axis load cell's cross-talk leaves unknown, however often it is
read: what is proportional to its torque is not claimed to be known better."""


class Estimate(NamedTuple):
    """A quantity with its uncertainty."""

    value: float
    uncertainty: float  # half width of the 95 % interval; NaN where nothing tells it
    unit: str
    method: str  # in a few words, with what the interval rests on

    def holds(self, truth: float) -> bool:
        """Whether a value lies within the interval."""
        return abs(truth - self.value) <= self.uncertainty


def factor(degrees: float) -> float:
    """Half width of a 95 % interval in standard errors; NaN without degrees of freedom."""
    return float(student.ppf(0.5 + 0.5 * SHARE, degrees)) if degrees > 0 else float("nan")


def mean(values: Any, unit: str, method: str) -> Estimate:
    """The mean of equally good and independent values; what is not finite is left out."""
    given = np.asarray(values, np.float64)
    given = given[np.isfinite(given)]
    if len(given) == 0:
        return Estimate(float("nan"), float("nan"), unit, method)
    error = np.std(given, ddof=1) / np.sqrt(len(given)) if len(given) > 1 else np.nan
    return Estimate(float(given.mean()), float(factor(len(given) - 1) * error), unit, method)


def with_floor(of: Estimate, share: float) -> Estimate:
    """The interval widened by a share of the value that no scatter tells, in quadrature."""
    return of._replace(uncertainty=float(np.hypot(of.uncertainty, share * of.value)))


def jackknife(whole: Floats, left_out: Floats) -> Floats:
    """Half widths of estimates, from the same estimates with one independent group left out each.

    ``whole`` (n,), ``left_out`` (groups, n). Efron & Stein (1981), Student's t with groups - 1.
    """
    count = len(left_out)
    if count < 2:
        return np.full(np.shape(whole), np.nan)
    off = left_out - left_out.mean(axis=0)
    out: Floats = factor(count - 1) * np.sqrt((count - 1) / count * (off * off).sum(axis=0))
    return out
