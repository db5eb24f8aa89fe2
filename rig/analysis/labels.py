"""Labels of gain-matrix columns and their values, for axes, captions and tables."""

from rig.analysis.run_columns import column_named, known_columns
from rig.config.columns import Column
from rig.presentation.phrases import format_signed

_DISPLAY_UNITS = {"switching_period": (1e6, "µs")}  # factor from SI, displayed unit
_SIGNED_UNITS = {"N/m", "N*s/m", "kg"}  # units of gains and rates, always shown with their sign


def column(name: str) -> Column:
    """Return a column by its name or its key in files; KeyError lists the valid names."""
    for each in known_columns():
        if name in (each.name, each.key):
            return each
    raise KeyError(
        f"no column {name!r}; allowed {', '.join(each.name for each in known_columns())}"
    )


def display_factor(column: Column) -> float:
    """Return the factor from SI to the displayed unit."""
    return _DISPLAY_UNITS.get(column.name, (1.0, ""))[0]


def display_unit(column: Column) -> str:
    """Return the displayed unit; empty for a dimensionless column."""
    unit = _DISPLAY_UNITS[column.name][1] if column.name in _DISPLAY_UNITS else column.unit
    return "" if unit == "1" else unit.replace("*", "·")


def axis_label(column: Column) -> str:
    """Return the label of an axis or a table column: name and unit."""
    return f"{column.label}, {display_unit(column)}" if display_unit(column) else column.label


def format_number(column: Column, value: float, digits: int = 4) -> str:
    """Return a value (SI) as text without its unit.

    Gains and rates are rounded to whole units, other values to ``digits`` significant digits.
    """
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


def format_settings(settings: dict[str, float]) -> str:
    """Return several columns and their values (SI, by column name) as text."""
    return ", ".join(format_setting(column_named(name), value) for name, value in settings.items())
