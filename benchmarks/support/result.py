"""Figures of benchmarks with their spread and their targets."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

Criterion = Literal["median", "worst"]


class Figure(NamedTuple):
    """One figure, measured ``repeats`` times."""

    name: str
    unit: str
    median: float
    low: float
    high: float
    repeats: int
    limit: str  # the target, e.g. "<= 20"; empty if there is none
    target_met: bool | None  # None: the figure has no target


class Result(NamedTuple):
    """Figures and conditions of one measurement."""

    name: str
    description: str  # one sentence
    repetitions: str  # number and kind of repetitions
    figures: tuple[Figure, ...]
    notes: tuple[str, ...] = ()  # conditions; omitted figures with the reason

    def as_dict(self) -> dict[str, Any]:
        """Return the result as JSON values."""
        return self._asdict() | {"figures": [figure._asdict() for figure in self.figures]}

    @property
    def missed(self) -> tuple[Figure, ...]:
        """Figures that miss their target."""
        return tuple(figure for figure in self.figures if figure.target_met is False)


def figure(
    name: str,
    unit: str,
    values: float | Iterable[float],
    *,
    at_most: float | None = None,
    at_least: float | None = None,
    criterion: Criterion = "median",
) -> Figure:
    """Return the figure of these repetitions, judged by their median or by the worst of them.

    Raises ValueError without values and for values that are not finite.
    """
    numbers = [float(values)] if isinstance(values, int | float) else [float(v) for v in values]
    if not numbers or not all(math.isfinite(value) for value in numbers):
        raise ValueError(f"{name}: no figure from {numbers}")
    median = float(np.median(numbers))
    limits: list[str] = []
    met: bool | None = None
    if at_least is not None:
        limits.append(f">= {at_least:g}")
        met = (median if criterion == "median" else min(numbers)) >= at_least
    if at_most is not None:
        limits.append(f"<= {at_most:g}")
        below = (median if criterion == "median" else max(numbers)) <= at_most
        met = below and met is not False
    limit = ", ".join(limits)
    if limit and criterion == "worst" and len(numbers) > 1:
        limit += " each"
    return Figure(name, unit, median, min(numbers), max(numbers), len(numbers), limit, met)


def quantile(values: Sequence[float] | npt.NDArray[Any], share: float) -> float:
    """Return the smallest value that at least ``share`` of the values do not exceed."""
    ordered = np.sort(np.asarray(values))
    return float(ordered[max(0, math.ceil(share * len(ordered)) - 1)])


def ratios(numerators: Iterable[float], denominators: Iterable[float]) -> list[float]:
    """Return the ratio of each block to its neighbour in time."""
    return [a / b for a, b in zip(numerators, denominators, strict=True)]


def table_cells(measured: Figure) -> tuple[str, ...]:
    """Return the figure as table cells: name, median, spread, unit, target, target met."""
    spread = (
        f"{format_number(measured.low)} - {format_number(measured.high)}"
        if measured.repeats > 1
        else ""
    )
    met = {True: "yes", False: "NO", None: ""}[measured.target_met]
    return measured.name, format_number(measured.median), spread, measured.unit, measured.limit, met


HEADINGS = ("figure", "median", "min - max", "unit", "target", "target met")


def format_number(value: float) -> str:
    """Format with three significant digits and no exponent; whole numbers in full."""
    if value == int(value) and abs(value) < 1e9:
        return f"{int(value)}"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(digits, 9)}f}"


def format_table(result: Result) -> str:
    """Return the result as a plain table."""
    rows = [HEADINGS, *(table_cells(measured) for measured in result.figures)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEADINGS))]
    lines = [f"{result.name}: {result.description}"]
    for row in rows:
        padded = [
            cell.rjust(width) if i in (1, 2) else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  " + "  ".join(padded).rstrip())
    lines += [f"  ({result.repetitions})", *(f"  note: {note}" for note in result.notes)]
    return "\n".join(lines)
