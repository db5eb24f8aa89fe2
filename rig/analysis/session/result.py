"""What a session's analysis hands to tables, figures, page and calibration file."""

from collections.abc import Callable, Mapping
from math import isnan
from types import MappingProxyType
from typing import Any, NamedTuple

from matplotlib.figure import SubFigure

from rig.analysis.session.estimate import Estimate


class Column(NamedTuple):
    """A column of a table; ``unit`` empty for texts and pure numbers."""

    name: str
    unit: str
    values: tuple[Any, ...]


class Table(NamedTuple):
    """A table in the thesis's form, the thesis's values beside the run's where it gives any."""

    name: str  # of its files
    title: str
    columns: tuple[Column, ...]


class Compared(NamedTuple):
    """A quantity beside the thesis's."""

    quantity: str
    thesis: str  # empty where the thesis gives none
    wanted: str  # what the run must show; empty where nothing was asked
    found: str
    held: bool | None  # whether it does; None where nothing was asked


class Picture(NamedTuple):
    """A figure of the thesis redrawn from the run."""

    name: str  # of its file
    title: str
    caption: str
    size: tuple[float, float]  # in
    draw: Callable[[SubFigure], None]


class Result(NamedTuple):
    """All that a session gives."""

    tables: tuple[Table, ...]
    compared: tuple[Compared, ...]
    constants: Mapping[str, Estimate]
    pictures: tuple[Picture, ...]
    notes: tuple[str, ...] = ()  # what a reader has to know, a sentence each
    maps: Mapping[str, Any] = MappingProxyType({})  # further parts of the calibration file


def number(value: float, digits: int = 4) -> str:
    """A number as people write it."""
    if isnan(value):
        return "–"
    return f"{value:.{digits}g}".replace("-", "−")


def words(of: Estimate, unit: str = "", times: float = 1.0) -> str:
    """Value and interval with as many digits as the interval allows."""
    value, half = times * of.value, times * of.uncertainty
    unit = unit or of.unit
    tail = "" if unit == "1" else f" {unit.replace('*', '·')}"
    if isnan(value):
        return "–"
    if isnan(half) or half == 0.0:
        return f"{number(value)}{tail}"
    places = max(0, 1 - _exponent(half))
    return f"{value:.{places}f} ± {half:.{places}f}{tail}".replace("-", "−")


def _exponent(value: float) -> int:
    """Of ten, of a number's first digit."""
    return int(f"{abs(value):e}".partition("e")[2])
