"""Straight line through points: its intervals and its confidence band."""

from typing import Any, NamedTuple

import numpy as np

from rig.kinds.oswec_bench.products.estimate import Estimate, Floats, coverage_factor


class Line(NamedTuple):
    """Least squares of y = intercept + slope x over independent points."""

    slope: float
    intercept: float
    residual_std: float  # standard deviation of the residuals, unit of y
    mean_x: float  # mean of x
    sum_squares_x: float  # sum of (x - mean_x)^2
    r_squared: float
    point_count: int

    @property
    def degrees_of_freedom(self) -> int:
        """Degrees of freedom."""
        return self.point_count - 2


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


def value_at(line: Line, x: Any) -> Any:
    """Return the line's value at x."""
    return line.intercept + line.slope * np.asarray(x, np.float64)


def band(line: Line, x: Any) -> Floats:
    """Return the half width of the 95 % confidence band of the line at x, unit of y."""
    deviation = np.asarray(x, np.float64) - line.mean_x
    variance = 1.0 / line.point_count + deviation * deviation / line.sum_squares_x
    half_width: Floats = (
        coverage_factor(line.degrees_of_freedom) * line.residual_std * np.sqrt(variance)
    )
    return half_width


def slope(line: Line, unit: str, method: str) -> Estimate:
    """Return the slope with its interval, by the scatter of the points about the line."""
    standard_error = line.residual_std / np.sqrt(line.sum_squares_x)
    return Estimate(
        line.slope, float(coverage_factor(line.degrees_of_freedom) * standard_error), unit, method
    )


def intercept(line: Line, unit: str, method: str) -> Estimate:
    """Return the value at x = 0 with its interval."""
    return Estimate(line.intercept, float(band(line, 0.0)), unit, method)
