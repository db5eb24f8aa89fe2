"""Lines fitted in quarters of a sinusoidal command, by direction: fits, table columns and figures.

Quarters are split by the command's own phase: rising and falling, of either sign. Fits choose their
domains in them (OSWEC thesis, Figs. 3.1 and 3.5: by hand and in rectangles; here by rule).
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from rig.kinds.oswec_bench.products import figures, periods
from rig.kinds.oswec_bench.products.estimate import Floats, Line, fit_line
from rig.kinds.oswec_bench.products.periods import PeriodCut
from rig.kinds.oswec_bench.products.result import Columns, R

DIRECTIONS = ((1, "clockwise", figures.CLOCKWISE), (-1, "counter-clockwise", figures.COUNTER))


class Quarter(NamedTuple):
    """A quarter of one oscillation."""

    sign: int  # of the command: 1, -1
    growing: bool  # the magnitude grows
    samples: slice  # in signals cut to their whole periods


class FitDomain(NamedTuple):
    """The part of a quarter to which a line was fitted."""

    quarter: Quarter
    samples: slice
    line: Line


def split_quarters(command: Floats, cut: PeriodCut) -> list[Quarter]:
    """Return every whole quarter of a command that is cut to its periods, in the order of time."""
    fundamental = periods.fundamentals(command, cut).mean()
    if not abs(fundamental) > 1e-9:
        return []
    quarter_samples = cut.period / cut.dt / 4.0
    # The command is a cosine of phase angle(turn): maxima where it is 0, a quarter every pi / 2.
    first = -float(np.angle(fundamental)) / (0.5 * np.pi)
    begin = int(np.ceil(-first - 1e-6))
    result = []
    for k in range(begin, begin + 4 * cut.period_count + 1):
        low, high = round((first + k) * quarter_samples), round((first + k + 1) * quarter_samples)
        if low < 0 or high > len(command):
            continue
        sign, growing = ((1, False), (-1, True), (-1, False), (1, True))[k % 4]
        result.append(Quarter(sign, growing, slice(low, high)))
    return result


def fit_domains(
    parts: list[Quarter],
    command: Floats,
    response: Floats,
    *,
    criterion: Floats,
    shares: tuple[float, float],
) -> list[FitDomain]:
    """Return the lines of response over command where ``criterion`` lies between shares of its
    peak in a quarter.

    ``criterion`` (a signal like the others) is multiplied by the quarter's sign; its first and last
    sample between the shares bound the domain. A quarter with fewer than ten samples gets no line.
    """
    domains = []
    for each in parts:
        magnitude = each.sign * criterion[each.samples]
        low, high = (share * magnitude.max() for share in shares)
        inside = np.flatnonzero((magnitude >= low) & (magnitude <= high))
        if len(inside) < 10 or magnitude.max() <= 0.0:
            continue
        start = each.samples.start
        samples = slice(start + int(inside[0]), start + int(inside[-1]) + 1)
        if np.ptp(command[samples]) > 0.0:
            line = fit_line(command[samples], response[samples])
            domains.append(FitDomain(each, samples, line))
    return domains


def of_direction(domains: list[FitDomain], sign: int) -> list[FitDomain]:
    """Return the domains of one direction (1: positive command)."""
    return [each for each in domains if each.quarter.sign == sign]


def direction_columns(unit: str, domains: Callable[[R], list[FitDomain]]) -> Columns[R]:
    """Return columns of the slopes, in ``unit``, and the smallest R² of a row's lines."""

    def cell(row: R, sign: int, name: str, statistic: Callable[[list[float]], float]) -> float:
        values = [getattr(each.line, name) for each in of_direction(domains(row), sign)]
        return float(statistic(values)) if values else float("nan")

    columns: dict[str, Callable[[R], Any]] = {}
    for sign, direction, _ in DIRECTIONS:
        for name, statistic in (("mean", np.mean), ("min", min), ("max", max)):
            heading = f"{direction} {name} [{unit}]"
            columns[heading] = partial(cell, sign=sign, name="slope", statistic=statistic)
        columns[f"{direction} R² min"] = partial(cell, sign=sign, name="r_squared", statistic=min)
    return columns


def thesis_value(
    value: float, first_column: tuple[float, ...], second_column: tuple[float, ...]
) -> float:
    """Return the second column of a table of the thesis for a value of its first, within 2 %; NaN
    if it has no such row.
    """
    for first, second in zip(first_column, second_column, strict=True):
        if abs(value / first - 1.0) < 0.02:
            return second
    return float("nan")


def draw_domain_boxes(axes: Axes, domains: list[FitDomain], dt: float, values: Floats) -> None:
    """Draw rectangles around the domains of fits."""
    for each in domains:
        low, high = values[each.samples].min(), values[each.samples].max()
        margin = 0.03 * np.ptp(values)
        x, width = dt * each.samples.start, dt * (each.samples.stop - each.samples.start)
        colour = figures.CLOCKWISE if each.quarter.sign > 0 else figures.COUNTER
        style: dict[str, Any] = {"fill": False, "ec": colour, "lw": 1.6, "zorder": 4}
        axes.add_patch(Rectangle((x, low - margin), width, high - low + 2.0 * margin, **style))


def draw_fits(
    panels: list[Axes],
    domains: list[FitDomain],
    signals: tuple[Floats, Floats],
    text: Callable[[Line], str],
    *,
    stride: int = 1,
    ms: float = 3.0,
    lw: float = 1.4,
) -> None:
    """Draw one domain of each direction in its panel: every ``stride``-th sample, and the line.

    ``signals`` are command and response; ``text`` describes a line.
    """
    for (sign, direction, colour), axes in zip(DIRECTIONS, panels, strict=True):
        for each in of_direction(domains, sign)[:1]:
            x, y = (signal[each.samples] for signal in signals)
            axes.plot(x[::stride], y[::stride], ".", ms=ms, color=figures.BLUE, alpha=0.5)
            axes.plot(x, each.line.at(x), color=colour, lw=lw)
            corner = "upper left" if sign > 0 else "lower right"
            figures.annotate_corner(axes, f"{direction}\n{text(each.line)}", corner)


def draw_line_ranges(
    panels: list[Axes],
    x: list[float],
    domains: list[list[FitDomain]],
    offset: float,
) -> None:
    """Draw slopes above and R² below: mean of each set point at ``x``, with bars to its extremes.

    Directions stand ``offset`` to the right and left of their ``x``.
    """
    for sign, direction, colour in DIRECTIONS:
        for axes, name in zip(panels, ("slope", "r_squared"), strict=True):
            label: str | None = direction
            for position, point_domains in zip(x, domains, strict=True):
                values = [getattr(d.line, name) for d in of_direction(point_domains, sign)]
                if not values:
                    continue
                mean = float(np.mean(values))
                bars = [[mean - min(values)], [max(values) - mean]]
                style: dict[str, Any] = {"fmt": "o", "ms": 4, "capsize": 3, "color": colour}
                axes.errorbar(position + sign * offset, mean, bars, label=label, **style)
                label = None
