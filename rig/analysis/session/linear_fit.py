"""A straight line through points: its intervals, its band, and what each point does to it."""

from typing import Any, NamedTuple

import numpy as np

from rig.analysis.session.estimate import Estimate, Floats, factor


class Line(NamedTuple):
    """Least squares of y = intercept + slope x over independent points."""

    slope: float
    intercept: float
    scatter: float  # standard deviation of the residuals, unit of y
    middle: float  # mean of x
    spread: float  # sum of (x - middle)^2
    r_squared: float
    points: int

    @property
    def degrees(self) -> int:
        """Degrees of freedom."""
        return self.points - 2


def line(x: Any, y: Any) -> Line:
    """The line through at least two points with different x; ValueError for fewer."""
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    good = np.isfinite(x) & np.isfinite(y)
    x, y = x[good], y[good]
    middle = x.mean() if len(x) else 0.0
    off = x - middle
    spread = float((off * off).sum())
    if len(x) < 2 or spread == 0.0:
        raise ValueError(f"no line through {len(x)} points at one place")
    level = y.mean()
    slope = float((off * (y - level)).sum() / spread)
    rest = y - level - slope * off
    lost = float((rest * rest).sum())
    total = float(((y - level) ** 2).sum())
    scatter = float(np.sqrt(lost / (len(x) - 2))) if len(x) > 2 else float("nan")
    return Line(
        slope,
        float(level - slope * middle),
        scatter,
        float(middle),
        spread,
        1.0 - lost / total if total > 0.0 else float("nan"),
        len(x),
    )


def at(fitted: Line, x: Any) -> Any:
    """The line's value at x."""
    return fitted.intercept + fitted.slope * np.asarray(x, np.float64)


def band(fitted: Line, x: Any) -> Floats:
    """Half width of the 95 % confidence band of the line at x, unit of y."""
    off = np.asarray(x, np.float64) - fitted.middle
    variance = 1.0 / fitted.points + off * off / fitted.spread
    out: Floats = factor(fitted.degrees) * fitted.scatter * np.sqrt(variance)
    return out


def slope(fitted: Line, unit: str, method: str) -> Estimate:
    """The slope with its interval, by the scatter of the points about the line."""
    error = fitted.scatter / np.sqrt(fitted.spread)
    return Estimate(fitted.slope, float(factor(fitted.degrees) * error), unit, method)


def intercept(fitted: Line, unit: str, method: str) -> Estimate:
    """The value at x = 0 with its interval."""
    return Estimate(fitted.intercept, float(band(fitted, 0.0)), unit, method)
