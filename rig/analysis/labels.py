"""Labels of gain-matrix columns and their values, for axes, captions and tables."""

import math
from collections.abc import Iterable, Mapping

from rig.analysis.points import Point
from rig.presentation.phrases import format_signed, unit_text
from rig.row_contents import Column

_FACTORS = {"": 1.0, "µs": 1e6}  # from SI, by displayed unit
_SIGNED_UNITS = {"N/m", "N*s/m", "kg"}  # units of gains and rates, always shown with their sign


def display_factor(column: Column) -> float:
    """Return the factor from SI to the displayed unit."""
    return _FACTORS[column.shown_unit]


def display_unit(column: Column) -> str:
    """Return the displayed unit; empty for a dimensionless column."""
    return unit_text(column.shown_unit or column.unit)


def axis_label(column: Column) -> str:
    """Return the label of an axis or a table column: name and unit."""
    return f"{column.label}, {display_unit(column)}" if display_unit(column) else column.label


def format_number(column: Column, value: float, digits: int = 4) -> str:
    """Return a value (SI) as text without its unit.

    Gains and rates are rounded to whole units, other values to ``digits`` significant digits. A
    value that stands for a name is that name.
    """
    if column.choices and value in range(len(column.choices)):
        return column.choices[int(value)]
    displayed = value * display_factor(column)
    if column.unit in _SIGNED_UNITS:
        return (
            format_signed(displayed)
            if abs(displayed) >= 10.0 or displayed == round(displayed)
            else format_signed(displayed, 1)
        )
    return f"{displayed:.{digits}g}".replace("-", "\N{MINUS SIGN}")


def format_quantity(column: Column, value: float, digits: int = 4) -> str:
    """Return a value (SI) as text with its unit."""
    return f"{format_number(column, value, digits)} {display_unit(column)}".rstrip()


def format_setting(column: Column, value: float) -> str:
    """Return a column's label and value with unit: ``spring rate −5715 N/m``."""
    return f"{column.label} {format_quantity(column, value)}"


def point_settings(columns: Iterable[Column], point: Point) -> str:
    """Return labels and values at a point as text, of the columns that its law has."""
    return ", ".join(
        format_setting(column, point.setting[column.name])
        for column in columns
        if column.name in point.setting and column.name not in point.lacking
    )


def format_settings(columns: Iterable[Column], settings: Mapping[str, float]) -> str:
    """Return settings (SI, by column name) as text."""
    by_name = {column.name: column for column in columns}
    return ", ".join(format_setting(by_name[name], value) for name, value in settings.items())


def heading(column: Column, *, unit: bool = True) -> str:
    """Return the heading of a narrow column."""
    text = column.heading or column.label
    return f"{text}, {display_unit(column)}" if unit and display_unit(column) else text


def best_values(columns: Iterable[Column], point: Point) -> list[tuple[Column, float]]:
    """Return the values of a point's columns, and of their actuators.

    NaN where unknown, and where the law of the point has no such column.
    """
    values = []
    for column in columns:
        known = column.name not in point.lacking
        values.append((column, point.setting.get(column.name, math.nan) if known else math.nan))
        if column.actuator is not None:
            values.append((column.actuator, point.actuator))
    return values


def panel_title(panel: Column | None, point: Point) -> str:
    """Return a point's value of the panel column, and the position of its actuator."""
    return ", ".join(
        f"{heading(column, unit=False)} {format_signed(value)} {display_unit(column)}"
        for column, value in best_values([panel] if panel else [], point)
    )
