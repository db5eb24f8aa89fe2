"""Figures with their spread and the number they have to hold."""

import math
from collections.abc import Iterable, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

Judge = Literal["median", "worst"]


class Figure(NamedTuple):
    """One figure, measured ``repeats`` times."""

    name: str
    unit: str
    median: float
    low: float
    high: float
    repeats: int
    limit: str  # the number to hold, e.g. "<= 20"; empty if there is none
    held: bool | None  # None: there is no number to hold


class Result(NamedTuple):
    """What one measurement gave."""

    name: str
    what: str  # one sentence
    repetitions: str  # how often what was done
    figures: tuple[Figure, ...]
    notes: tuple[str, ...] = ()  # conditions, and what was left out and why

    def as_dict(self) -> dict[str, Any]:
        """The result as JSON values."""
        return self._asdict() | {"figures": [figure._asdict() for figure in self.figures]}

    @property
    def missed(self) -> tuple[Figure, ...]:
        """Figures that do not hold their number."""
        return tuple(figure for figure in self.figures if figure.held is False)


def figure(
    name: str,
    unit: str,
    values: float | Iterable[float],
    *,
    at_most: float | None = None,
    at_least: float | None = None,
    judge: Judge = "median",
) -> Figure:
    """A figure from its repetitions, held or not by their median or by the worst of them."""
    several = [float(values)] if isinstance(values, int | float) else [float(v) for v in values]
    if not several or not all(math.isfinite(value) for value in several):
        raise ValueError(f"{name}: no figure from {several}")
    median = float(np.median(several))
    limits: list[str] = []
    held: bool | None = None
    if at_least is not None:
        limits.append(f">= {at_least:g}")
        held = (median if judge == "median" else min(several)) >= at_least
    if at_most is not None:
        limits.append(f"<= {at_most:g}")
        below = (median if judge == "median" else max(several)) <= at_most
        held = below and held is not False
    limit = ", ".join(limits)
    if limit and judge == "worst" and len(several) > 1:
        limit += " each"
    return Figure(name, unit, median, min(several), max(several), len(several), limit, held)


def quantile(values: Sequence[float] | npt.NDArray[Any], share: float) -> float:
    """The smallest of the values that at least ``share`` of them do not exceed."""
    ordered = np.sort(np.asarray(values))
    return float(ordered[max(0, math.ceil(share * len(ordered)) - 1)])


def ratios(ours: Iterable[float], theirs: Iterable[float]) -> list[float]:
    """Block by block, each against its neighbour in time."""
    return [a / b for a, b in zip(ours, theirs, strict=True)]


def cells(one: Figure) -> tuple[str, ...]:
    """The figure as table cells: name, median, spread, unit, limit, held."""
    spread = f"{number(one.low)} - {number(one.high)}" if one.repeats > 1 else ""
    held = {True: "yes", False: "NO", None: ""}[one.held]
    return one.name, number(one.median), spread, one.unit, one.limit, held


HEADINGS = ("figure", "median", "min - max", "unit", "to hold", "held")


def number(value: float) -> str:
    """Three digits that count, whole numbers in full, no exponent."""
    if value == int(value) and abs(value) < 1e9:
        return f"{int(value)}"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(digits, 9)}f}"


def text(result: Result) -> str:
    """The result as a plain table."""
    rows = [HEADINGS, *(cells(one) for one in result.figures)]
    widths = [max(len(row[i]) for row in rows) for i in range(len(HEADINGS))]
    lines = [f"{result.name}: {result.what}"]
    for row in rows:
        padded = [
            cell.rjust(width) if i in (1, 2) else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  " + "  ".join(padded).rstrip())
    lines += [f"  ({result.repetitions})", *(f"  note: {note}" for note in result.notes)]
    return "\n".join(lines)
