"""The contents of a row table: what the rows of a gain matrix vary, and what is measured of each.

A kind of rig declares them as it declares its power stations. A run records them in its plan; rows,
effects, pictures and reports all follow from them.
"""

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from rig import stations
from rig.stations import Station

PANEL, X, Y, LAW, DRIVE, CATEGORICAL = "panel", "x", "y", "law", "drive", "categorical"
"""Roles of a column: surfaces have one panel for each value of `PANEL`, over `X` and `Y`. These
three are the main columns. `LAW` is any other set point of the control law, `DRIVE` a setting of
the drive, zero in all rows of a drive without settings; values of `CATEGORICAL` have no order."""

MATCH = "impedance_match"
"""Key of a plan and attribute of a row table: gains that match the plant's impedance, SI."""


class Column(NamedTuple):
    """One quantity that may change from row to row."""

    key: str  # in files
    name: str  # of the set point, and in the row table
    unit: str  # SI
    label: str  # on axes
    role: str = ""  # in pictures and tables
    field: str = ""  # log field with its value
    tolerance: float = 0.0  # SI; largest difference of set points of two runs that are compared
    heading: str = ""  # of a narrow column; empty: the label
    shown_unit: str = ""  # in pictures and texts; empty: the unit
    actuator: "Column | None" = None  # position of the device that realises a set point
    choices: tuple[str, ...] = ()  # names that stand for the values 0, 1, ...
    laws: tuple[str, ...] = ()  # of a choice, those with the column; empty: all


class Check(NamedTuple):
    """A number that the row table has of each row, besides power and motion."""

    name: str
    unit: str
    statistic: str  # one of `rig.analysis.rows.STATISTICS`
    fields: tuple[str, ...]  # log fields, added up
    zero: str = ""  # log field that is subtracted


class RowContents(NamedTuple):
    """The contents of the row table of a run."""

    axis: str  # prefix of the log fields of the axis whose motion and force are measured
    stations: tuple[Station, ...]
    columns: tuple[Column, ...]
    checks: tuple[Check, ...]
    control: tuple[str, ...] = ()
    """Sections of campaign and rig file with settings of the control, besides those of the law."""
    signals: Mapping[str, tuple[str, ...]] = MappingProxyType({})
    """The signals of the stations' formulas: a log field, and log fields that are subtracted."""

    @property
    def settings(self) -> tuple[Column, ...]:
        """The columns, each with its actuator."""
        pairs = ((column, column.actuator) for column in self.columns)
        return tuple(each for pair in pairs for each in pair if each is not None)

    def as_records(self) -> dict[str, Any]:
        """Return the contents as JSON values, as in a run's plan."""
        return {
            "axis": self.axis,
            "stations": stations.as_records(self.stations),
            "columns": column_records(self.columns),
            "checks": [check._asdict() for check in self.checks],
            "control": list(self.control),
            "signals": {name: list(fields) for name, fields in self.signals.items()},
        }


def column_records(columns: Iterable[Column]) -> list[dict[str, Any]]:
    """Return columns as JSON values."""

    def record(column: Column) -> dict[str, Any]:
        values = column._asdict()
        return values if column.laws else {k: v for k, v in values.items() if k != "laws"}

    return [
        record(column) | {"actuator": column.actuator and record(column.actuator)}
        for column in columns
    ]


def is_lacking(column: Column, columns: Iterable[Column], setting: Mapping[str, float]) -> bool:
    """Return whether the law of a set point has no such column; its value there means nothing.

    ``columns`` contain those that choose the laws: `law`, or `AXIS_law` of several axes.
    """
    return bool(column.laws) and any(
        each.choices
        and each.name.endswith("law")
        and column.name.startswith(each.name.removesuffix("law"))
        and each.name in setting
        and each.choices[int(setting[each.name])] not in column.laws
        for each in columns
    )


def columns_from_records(
    records: Iterable[Mapping[str, Any]], earlier: Iterable[Column] = ()
) -> tuple[Column, ...]:
    """Return the columns of a recorded table; fields that today's `Column` lacks are ignored.

    Runs recorded before 2027 list columns without their roles: those of ``earlier`` by name, and
    those of the law.
    """
    by_name = {column.name: column for column in earlier}

    def read(record: Mapping[str, Any]) -> Column:
        given = {name: record[name] for name in Column._fields if name in record}
        if "role" not in given:
            known = by_name.get(given["name"], Column("", "", "", "", LAW))
            return known._replace(**given)
        if given.get("actuator"):
            given["actuator"] = read(given["actuator"])
        given["choices"] = tuple(given.get("choices", ()))
        given["laws"] = tuple(given.get("laws", ()))
        return Column(**given)

    return tuple(map(read, records))


def from_records(record: Mapping[str, Any], earlier: "RowContents | None" = None) -> RowContents:
    """Return the contents in a run's plan; those that it lacks are those of ``earlier``."""

    def listed(key: str, read: Callable[[Any], Any]) -> Any:
        value = record.get(key)
        return getattr(earlier, key) if value is None and earlier is not None else read(value)

    return RowContents(
        listed("axis", str),
        listed("stations", stations.from_records),
        listed(
            "columns",
            lambda value: columns_from_records(value, earlier.columns if earlier else ()),
        ),
        listed(
            "checks",
            lambda value: tuple(
                Check(**{n: each[n] for n in Check._fields if n in each})._replace(
                    fields=tuple(each["fields"])
                )
                for each in value
            ),
        ),
        tuple(listed("control", lambda value: value or ())),
        listed("signals", lambda value: {k: tuple(v) for k, v in (value or {}).items()}),
    )


def with_role(columns: Iterable[Column], role: str) -> Column | None:
    """Return the first column with a role; None without one."""
    return next((column for column in columns if column.role == role), None)


def main_columns(columns: Iterable[Column]) -> tuple[Column, ...]:
    """Return the columns that surfaces show: panel, y and x, as far as there are any."""
    every = tuple(columns)
    return tuple(c for role in (PANEL, Y, X) if (c := with_role(every, role)) is not None)


def find_column(columns: Iterable[Column], name: str) -> Column:
    """Return a column by its name or its key in files; KeyError lists the valid names."""
    every = tuple(columns)
    for column in every:
        if name in (column.name, column.key):
            return column
    raise KeyError(f"no column {name!r}; allowed {', '.join(each.name for each in every)}")


def union(*groups: Iterable[Column]) -> tuple[Column, ...]:
    """Return the columns of several runs, one for each name, in order."""
    found: dict[str, Column] = {}
    for group in groups:
        for column in group:
            found.setdefault(column.name, column)
    return tuple(found.values())
