"""The columns of a run's gain matrix: as its record lists them, so that its law need not be here.

Runs recorded before a law could be chosen list none: they have the columns of the impedance law.
"""

import json
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from rig.config.columns import COLUMNS, Column

if TYPE_CHECKING:
    import xarray

ATTRIBUTE = "columns"
"""Attribute of a row table with the columns of its run as JSON; absent: those of `COLUMNS`."""

_BY_NAME = {column.name: column for column in COLUMNS}
_OF_OTHER_LAWS: dict[str, Column] = {}  # of the runs read in this process


def plan_columns(plan: dict[str, Any]) -> tuple[Column, ...]:
    """Return the columns that a run's plan lists, else those of the impedance law."""
    return _remember(_columns(plan.get("columns")))


def table_columns(table: "xarray.Dataset") -> tuple[Column, ...]:
    """Return the columns of a row table or of a sweep's result."""
    text = table.attrs.get(ATTRIBUTE)
    return _remember(_columns(json.loads(text) if text else None))


def attributes(columns: tuple[Column, ...]) -> dict[str, str]:
    """Return the attribute of a dataset with these columns; empty for those of `COLUMNS`."""
    if columns == COLUMNS:
        return {}
    return {ATTRIBUTE: json.dumps([column._asdict() for column in columns])}


def column_named(name: str) -> Column:
    """Return the column of a name, of any run read in this process; KeyError without one."""
    return _BY_NAME.get(name) or _OF_OTHER_LAWS[name]


def known_columns() -> tuple[Column, ...]:
    """Return the columns of all runs read in this process."""
    return (*COLUMNS, *_OF_OTHER_LAWS.values())


def union(groups: Iterable[tuple[Column, ...]]) -> tuple[Column, ...]:
    """Return the columns of several runs, one for each name, in order."""
    found: dict[str, Column] = {}
    for group in groups:
        for column in group:
            found.setdefault(column.name, column)
    return tuple(found.values())


def _columns(listed: Any) -> tuple[Column, ...]:
    if not isinstance(listed, list):
        return COLUMNS
    return tuple(Column(*(str(each.get(field, "")) for field in Column._fields)) for each in listed)


def _remember(columns: tuple[Column, ...]) -> tuple[Column, ...]:
    for column in columns:
        if column.name not in _BY_NAME:
            _OF_OTHER_LAWS[column.name] = column
    return columns
