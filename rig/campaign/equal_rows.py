"""Rows of a prediction that print the same numbers although their set points differ."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

from rig.row_contents import Column

_DIGITS = 9  # significant ones of equal numbers; the others may be rounding
_MAX_ROWS = 12  # in a text


class EqualRows(NamedTuple):
    """Rows with one prediction, in the order of the plan."""

    rows: tuple[int, ...]
    columns: tuple[str, ...]  # keys of the set points in which they differ
    changed: tuple[str, ...]  # predicted numbers that differ nevertheless, but are not shown
    digits: bool  # the numbers shown differ, too, by less than their last digit

    def reason(self) -> str:
        """Return why the rows have one prediction."""
        columns = " and ".join(self.columns)
        if self.digits:
            return f"differ only in {columns}, by too little for the digits shown"
        if not self.changed:
            return f"differ only in {columns}, on which this prediction does not depend"
        return (
            f"differ only in {columns}; of this prediction that changes {', '.join(self.changed)}"
        )

    def text(self) -> str:
        """Return rows and reason."""
        listed = ", ".join(map(str, self.rows[:_MAX_ROWS]))
        more = len(self.rows) - _MAX_ROWS
        return f"rows {listed}{f' and {more} more' if more > 0 else ''} {self.reason()}"

    def as_dict(self) -> dict[str, Any]:
        """Return the rows, the differing columns and the reason as JSON values."""
        return {
            "rows": list(self.rows),
            "columns": list(self.columns),
            "changed": list(self.changed),
            "reason": self.reason(),
        }


def find_equal_rows(
    rows: Iterable[Mapping[str, Any]],
    columns: Sequence[Column],
    numbers: Sequence[str],
    shown: Mapping[str, str],
) -> tuple[EqualRows, ...]:
    """Return the groups of rows that print the same numbers and have different set points.

    A row has its number as `row`, its set points by the names of ``columns``, and its results by
    the names of ``numbers``; rows that lack a shown result are left out. ``shown`` has the format
    of each number in tables.
    """
    groups: dict[tuple[str, ...], list[Mapping[str, Any]]] = {}
    for row in rows:
        if all(name in row for name in shown):
            printed = tuple(format(row[name], digits) for name, digits in shown.items())
            groups.setdefault(printed, []).append(row)
    found = []
    for group in groups.values():
        differing = tuple(c.key for c in columns if len({row.get(c.name) for row in group}) > 1)
        if not differing:
            continue
        changed = tuple(name for name in numbers if len({_digits(row, name) for row in group}) > 1)
        found.append(
            EqualRows(
                tuple(row["row"] for row in group),
                differing,
                changed,
                any(name in shown for name in changed),
            )
        )
    return tuple(found)


def _digits(row: Mapping[str, Any], name: str) -> Any:
    """Return a number without the digits of rounding errors."""
    value = row.get(name)
    return format(value, f".{_DIGITS}g") if isinstance(value, float) else value
