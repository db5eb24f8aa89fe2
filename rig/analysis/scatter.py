"""Type A uncertainty: the standard error of a mean power from the scatter of the periods of a row.

Means of successive periods may be correlated (drift, reflected waves, a limit cycle over several
periods), which makes their mean less certain than their scatter suggests. A row with a significant
correlation counts as fewer, effective, periods: those of an autoregressive process of first order,
whose correlation is estimated without the bias of short series.

A few periods do not show their correlation: with 8 of them, one of 0.6 is found in a third of the
rows, and the interval covers 76 % in place of 95 (69 % without this). Fewer than 4 periods count as
independent. Where that matters, repeat points or measure longer rows.
"""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

SIGNIFICANCE_QUANTILE = 1.6449  # one-sided 5 %: white scatter passes for correlated this often
MOST_CORRELATION = 0.95
LEAST_EFFECTIVE = 3.0  # periods; one degree of freedom would give an interval of no use


class MeanError(NamedTuple):
    """Standard error of a mean, and what it is known by; both NaN for fewer than two values."""

    error: float  # in the unit of the values
    dof: float  # degrees of freedom: effective number of values less one


UNKNOWN = MeanError(float("nan"), float("nan"))
NO_ERROR = MeanError(0.0, float("inf"))


def period_means(values: Any, ticks: Any, period_ticks: float) -> Any:
    """Return the means of ``values`` over each whole period of ``period_ticks`` ticks."""
    elapsed = ticks - ticks[0]
    # Windows end on the nearest sample, so the last period may lack half a tick.
    periods = int((elapsed[-1] + 1.5) / period_ticks)
    edges = np.searchsorted(elapsed, np.round(np.arange(periods + 1) * period_ticks))
    nonempty = np.flatnonzero(np.diff(edges))
    return np.array([values[edges[i] : edges[i + 1]].mean() for i in nonempty])


def standard_error(means: Any) -> float:
    """Return the standard error of the mean of independent values; NaN for fewer than two.

    Such are means of seas with different seeds, and differences between pairs of them.
    """
    count = len(means)
    return float(np.std(means, ddof=1) / np.sqrt(count)) if count > 1 else float("nan")


def error_of_sum(errors: Iterable[MeanError]) -> MeanError:
    """Return the standard error of a sum of independent values (Welch and Satterthwaite)."""
    errors = tuple(errors)
    if not all(np.isfinite(each.error) and each.dof > 0.0 for each in errors):
        return UNKNOWN
    variance = sum(each.error**2 for each in errors)
    spread = sum(each.error**4 / each.dof for each in errors)
    return MeanError(variance**0.5, variance**2 / spread if spread else NO_ERROR.dof)


def successive_error(means: Any) -> MeanError:
    """Return the standard error of the mean of successive periods, which may be correlated.

    The variance of the mean of n values is their variance over n times 1 + 2 sum (1 - k / n) rho^k,
    and their variance about the mean is too small by the same correlation (Priestley, Spectral
    Analysis and Time Series, 5.3).
    """
    values = np.asarray(means, np.float64)
    number = len(values)
    if number < 2:
        return UNKNOWN
    deviations = values - values.mean()
    squares = float(deviations @ deviations)
    correlation = _correlation(deviations, squares)
    if correlation <= 0.0:
        return MeanError(standard_error(values), number - 1.0)
    lags = np.arange(1, number)
    inflation = 1.0 + 2.0 * float(np.sum((1.0 - lags / number) * correlation**lags))
    dof = max(number / inflation, min(float(number), LEAST_EFFECTIVE)) - 1.0
    return MeanError(float(np.sqrt(squares / number / dof)), dof)


def _correlation(deviations: Any, squares: float) -> float:
    """Return the correlation of successive values; 0 if it is not significant.

    The test is that against white scatter (Moran, Biometrika 35, 1948), the correction of the bias
    of short series that of Marriott and Pope (Biometrika 41, 1954).
    """
    number = len(deviations)
    if squares == 0.0:
        return 0.0
    found = float(deviations[1:] @ deviations[:-1]) / squares
    deviation = (number - 2) / (number * np.sqrt(number - 1.0))
    if found <= SIGNIFICANCE_QUANTILE * deviation - 1.0 / number:
        return 0.0
    return min(found + (1.0 + 4.0 * found) / number, MOST_CORRELATION)
