"""Results of a session's analysis, as tables, figures, page and calibration file use them."""

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, TypeVar

from rig.kinds.oswec_bench.products.estimate import Estimate
from rig.kinds.oswec_bench.products.figures import FigureSpec

R = TypeVar("R")
Columns = Mapping[str, Callable[[R], Any]]
"""Cell of a row by heading: ``name [unit]``, or ``name`` for texts and pure numbers."""


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


def table(name: str, title: str, rows: Iterable[R], columns: Columns[R]) -> Table:
    """Return a table with a row for each of ``rows``.

    A column of estimates becomes two: their values and, ``name ±``, their half widths.
    """
    rows = tuple(rows)
    filled = []
    for heading, cell in columns.items():
        quantity, _, rest = heading.partition(" [")
        unit, values = rest.removesuffix("]"), tuple(cell(row) for row in rows)
        if any(isinstance(value, Estimate) for value in values):
            filled.append(Column(quantity, unit, tuple(each.value for each in values)))
            quantity, values = f"{quantity} ±", tuple(each.uncertainty for each in values)
        filled.append(Column(quantity, unit, values))
    return Table(name, title, tuple(filled))


Verdict = Literal["", "met", "missed", "undecided"]
"""Undecided: the interval of the quantity contains values that meet the target, and others."""


class Comparison(NamedTuple):
    """A quantity compared with the thesis's."""

    quantity: str
    thesis: str  # empty if the thesis gives none
    target: str  # requirement on the run; empty if there is none
    measured: str
    target_met: bool | None  # whether the run meets the target; None without one, or undecided

    @property
    def verdict(self) -> Verdict:
        """The verdict on the target; empty without one."""
        if self.target_met is None:
            return "undecided" if self.target else ""
        return "met" if self.target_met else "missed"

    @classmethod
    def of_constant(cls, quantity: str, measured: Estimate, thesis: float) -> "Comparison":
        """Return a constant, compared with the thesis's, from which it may differ by 2 %."""
        deviation = measured.value / thesis - 1.0
        text = f"{measured} ({100.0 * deviation:+z.1f} %)"
        unit = measured.unit.replace("*", "·")
        return cls(quantity, f"{thesis} {unit}", "within 2 %", text, abs(deviation) <= 0.02)


def compare(
    quantity: str,
    measured: str | Estimate,
    thesis: str = "",
    target: str = "",
    target_met: bool | None = None,
) -> Comparison:
    """Return a measured quantity, compared with what the thesis and a target say of it."""
    return Comparison(quantity, thesis, target, str(measured), target_met)


class Result(NamedTuple):
    """All results of a session."""

    tables: tuple[Table, ...]
    comparisons: tuple[Comparison, ...]
    constants: Mapping[str, Estimate]
    figures: tuple[FigureSpec, ...]
    notes: tuple[str, ...] = ()  # notes for the reader, one sentence each
    maps: Mapping[str, Any] = MappingProxyType({})  # further parts of the calibration file
    errors: Mapping[str, Estimate] = MappingProxyType({})
    """Errors of following a reference, which are no constants of the bench, for sweeps."""
