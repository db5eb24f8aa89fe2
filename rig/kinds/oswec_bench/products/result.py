"""Results of a session's analysis, as tables, figures, page and calibration file use them."""

from collections.abc import Callable, Mapping
from math import isnan
from types import MappingProxyType
from typing import Any, NamedTuple

from matplotlib.figure import SubFigure

from rig.kinds.oswec_bench.products.estimate import Estimate


class Column(NamedTuple):
    """A column of a table; ``unit`` is empty for texts and pure numbers."""

    name: str
    unit: str
    values: tuple[Any, ...]


class Table(NamedTuple):
    """A table in the thesis's form, with the thesis's values for comparison where it gives any."""

    name: str  # stem of its file names
    title: str
    columns: tuple[Column, ...]


class Comparison(NamedTuple):
    """A quantity compared with the thesis's."""

    quantity: str
    thesis: str  # empty if the thesis gives none
    target: str  # requirement on the run; empty if there is none
    measured: str
    target_met: bool | None  # whether the run meets the target; None without a target


class FigureSpec(NamedTuple):
    """A figure of the thesis, redrawn from the run."""

    name: str  # stem of its file name
    title: str
    caption: str
    size: tuple[float, float]  # in
    draw: Callable[[SubFigure], None]


class Result(NamedTuple):
    """All results of a session."""

    tables: tuple[Table, ...]
    comparisons: tuple[Comparison, ...]
    constants: Mapping[str, Estimate]
    figures: tuple[FigureSpec, ...]
    notes: tuple[str, ...] = ()  # notes for the reader, one sentence each
    maps: Mapping[str, Any] = MappingProxyType({})  # further parts of the calibration file


def format_number(value: float, digits: int = 4) -> str:
    """Return a number for people: minus sign, dash for NaN."""
    if isnan(value):
        return "–"
    return f"{value:.{digits}g}".replace("-", "−")


def format_estimate(estimate: Estimate, unit: str = "", factor: float = 1.0) -> str:
    """Return value and interval, with as many digits as the interval supports."""
    value, half_width = factor * estimate.value, factor * estimate.uncertainty
    unit = unit or estimate.unit
    unit_suffix = "" if unit == "1" else f" {unit.replace('*', '·')}"
    if isnan(value):
        return "–"
    if isnan(half_width) or half_width == 0.0:
        return f"{format_number(value)}{unit_suffix}"
    decimals = max(0, 1 - _decimal_exponent(half_width))
    return f"{value:.{decimals}f} ± {half_width:.{decimals}f}{unit_suffix}".replace("-", "−")


def _decimal_exponent(value: float) -> int:
    """Return the power of ten of a number's first digit."""
    return int(f"{abs(value):e}".partition("e")[2])
