"""A result of a session: a value with the half width of its 95 % interval.

Samples of one run are not independent of each other, so no interval is based on their number. Each
interval is based on the scatter between oscillations, set points or runs, as the functions state.
"""

from collections.abc import Callable, Sequence
from math import isnan
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.polynomial import Polynomial
from scipy.special import stdtrit

Floats = npt.NDArray[np.float64]

_SINGULAR = 1e-9  # eigenvalue of normal equations with unit diagonal

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

    def __str__(self) -> str:
        """Return value, interval and unit, with as many digits as the interval supports."""
        if isnan(self.value):
            return "–"
        unit = "" if self.unit == "1" else f" {self.unit.replace('*', '·')}"
        if isnan(self.uncertainty) or self.uncertainty == 0.0:
            return f"{format_number(self.value)}{unit}"
        exponent = int(f"{abs(self.uncertainty):e}".partition("e")[2])
        digits = f".{max(0, 1 - exponent)}f"
        return f"{self.value:{digits}} ± {self.uncertainty:{digits}}{unit}".replace("-", "−")

    def covers(self, truth: float) -> bool:
        """Return whether a value lies within the interval."""
        return abs(truth - self.value) <= self.uncertainty

    @property
    def is_negative(self) -> bool | None:
        """Whether the quantity is below zero; None if the interval contains zero."""
        return None if self.covers(0.0) else self.value < 0.0

    def scaled(self, factor: float, unit: str) -> "Estimate":
        """Return the estimate times a factor, in another unit."""
        return Estimate(factor * self.value, factor * self.uncertainty, unit, self.method)

    def widened(self, half_width: float) -> "Estimate":
        """Return the estimate, its interval widened in quadrature by that of another error, which
        no scatter reveals.
        """
        return self._replace(uncertainty=float(np.hypot(self.uncertainty, half_width)))

    def with_cell_error(self) -> "Estimate":
        """Return an estimate proportional to a torque, its interval widened by the cell's error."""
        return self.widened(CELL_UNCERTAINTY * self.value)


def format_number(value: float, digits: int = 4) -> str:
    """Return a number for people: minus sign, dash for NaN."""
    return "–" if isnan(value) else f"{value:.{digits}g}".replace("-", "−")


def coverage_factor(degrees_of_freedom: float) -> float:
    """Return the half width of a 95 % interval in standard errors.

    The result is NaN without degrees of freedom.
    """
    if degrees_of_freedom <= 0:
        return float("nan")
    return float(stdtrit(degrees_of_freedom, 0.5 + 0.5 * CONFIDENCE))


def mean(values: Any, unit: str, method: str) -> Estimate:
    """Return the mean of equally accurate and independent values; values that are not finite are
    ignored. Without any value the mean is NaN.
    """
    samples = np.asarray(values, np.float64)
    samples = samples[np.isfinite(samples)]
    if len(samples) == 0:
        return Estimate(float("nan"), float("nan"), unit, method)
    error = np.std(samples, ddof=1) / np.sqrt(len(samples)) if len(samples) > 1 else np.nan
    half_width = float(coverage_factor(len(samples) - 1) * error)
    return Estimate(float(samples.mean()), half_width, unit, method)


def jackknifed(
    values: Any, left_out: Sequence[Any], units: Sequence[str], method: str
) -> list[Estimate]:
    """Return ``values`` (n,) as estimates, from the same values with one independent group left out
    each, ``left_out`` (groups, n).

    Efron & Stein (1981), Student's t with groups - 1. The intervals of one group are NaN.
    """
    count = len(left_out)
    deviations = np.array(left_out) - np.mean(left_out, axis=0)
    errors = np.sqrt((count - 1) / count * (deviations * deviations).sum(axis=0))
    half_widths = coverage_factor(count - 1) * errors
    return [
        Estimate(float(value), float(half_width), unit, method)
        for value, half_width, unit in zip(values, half_widths, units, strict=True)
    ]


def solve_groups(
    groups: Sequence[tuple[Floats, Floats]], solve: Callable[[Any, Any], Any]
) -> Floats:
    """Return least squares over all groups, then without each: (groups + 1, unknowns).

    A group is its design (samples, unknowns) and its values (samples,). ``solve`` solves normal
    equations, whose columns are scaled to equal size.
    """
    scale = np.sqrt(sum((x * x).sum(axis=0) for x, _ in groups))
    scale = np.where(scale > 0.0, scale, 1.0)
    grams = np.array([(x / scale).T @ (x / scale) for x, _ in groups])
    right_sides = np.array([(x / scale).T @ y for x, y in groups])
    gram, right = grams.sum(axis=0), right_sides.sum(axis=0)
    left_out = zip(gram - grams, right - right_sides, strict=True)
    return np.array([solve(g, r) for g, r in [(gram, right), *left_out]]) / scale


class Line(NamedTuple):
    """Least squares of y = intercept + slope x over independent points."""

    slope: float
    intercept: float
    residual_std: float  # standard deviation of the residuals, unit of y
    mean_x: float  # mean of x
    sum_squares_x: float  # sum of (x - mean_x)^2
    r_squared: float
    point_count: int

    def at(self, x: Any) -> Any:
        """Return the line's value at x."""
        return self.intercept + self.slope * np.asarray(x, np.float64)

    def band(self, x: Any) -> Floats:
        """Return the half width of the 95 % confidence band of the line at x, unit of y."""
        deviation = np.asarray(x, np.float64) - self.mean_x
        variance = 1.0 / self.point_count + deviation * deviation / self.sum_squares_x
        factor = coverage_factor(self.point_count - 2) * self.residual_std
        return factor * np.sqrt(variance)

    def slope_estimate(self, unit: str = "", method: str = "") -> Estimate:
        """Return the slope with its interval, by the scatter of the points about the line."""
        standard_error = self.residual_std / np.sqrt(self.sum_squares_x)
        half_width = float(coverage_factor(self.point_count - 2) * standard_error)
        return Estimate(self.slope, half_width, unit, method)

    def intercept_estimate(self, unit: str = "", method: str = "") -> Estimate:
        """Return the value at x = 0 with its interval."""
        return Estimate(self.intercept, float(self.band(0.0)), unit, method)


def fit_line(x: Any, y: Any) -> Line:
    """Return the line through at least two points with different x; ValueError for fewer."""
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    finite = np.isfinite(x) & np.isfinite(y)
    x, y = x[finite], y[finite]
    mean_x = x.mean() if len(x) else 0.0
    deviation = x - mean_x
    sum_squares_x = float((deviation * deviation).sum())
    if len(x) < 2 or sum_squares_x == 0.0:
        raise ValueError(f"no line through {len(x)} points at one x")
    mean_y = y.mean()
    slope = float((deviation * (y - mean_y)).sum() / sum_squares_x)
    residual = y - mean_y - slope * deviation
    residual_squares = float((residual * residual).sum())
    total_squares = float(((y - mean_y) ** 2).sum())
    residual_std = float(np.sqrt(residual_squares / (len(x) - 2))) if len(x) > 2 else float("nan")
    return Line(
        slope,
        float(mean_y - slope * mean_x),
        residual_std,
        float(mean_x),
        sum_squares_x,
        1.0 - residual_squares / total_squares if total_squares > 0.0 else float("nan"),
        len(x),
    )


class NormalEquations(NamedTuple):
    """Normal equations of one group by grid point, for a fit that is linear but for one parameter.

    The parameter is searched on a grid. The contribution of each independent group (a set point) is
    stored separately, so leaving out a group costs almost nothing, and the intervals of all
    parameters, the searched one included, follow from the scatter between groups (jackknife).
    """

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
    scaled = gram / (scale[:, :, None] * scale[:, None, :])
    # Below it the data do not determine a grid point.
    regular = np.linalg.eigvalsh(scaled)[:, 0] > _SINGULAR
    scaled[~regular] = np.eye(scaled.shape[1])
    solutions = np.linalg.solve(scaled, (right / scale)[:, :, None])[:, :, 0] / scale
    residual_squares = np.where(
        regular, value_squares - np.einsum("ki,ki->k", right, solutions), np.inf
    )
    best = int(np.argmin(residual_squares))
    minimum = float(grid[best])
    around = slice(best - 1, best + 2)
    if 0 < best < len(grid) - 1 and np.isfinite(residual_squares[around]).all():
        slope = Polynomial.fit(grid[around], residual_squares[around], 2).deriv()
        for root in slope.roots():  # none where the three are equal
            minimum = float(np.clip(root, grid[best - 1], grid[best + 1]))
    parameters = [
        np.interp(minimum, grid[regular], solutions[regular, i]) for i in range(solutions.shape[1])
    ]
    return np.array([*parameters, minimum]), float(residual_squares[best])
