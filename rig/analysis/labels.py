"""How the columns of a gain matrix are written on axes, in captions and in tables."""

from rig.analysis.phrases import signed
from rig.config.columns import COLUMNS, Column

BY_NAME = {column.name: column for column in COLUMNS}

_SHOWN = {"switching_period": (1e6, "µs")}  # factor from SI, unit people read
_SIGNED = {"N/m", "N*s/m", "kg"}  # gains and rates: their sign is half of what they say


def column(name: str) -> Column:
    """A column by its name or its key in files; KeyError names those there are."""
    for each in COLUMNS:
        if name in (each.name, each.key):
            return each
    raise KeyError(f"no column {name!r}; there are {', '.join(BY_NAME)}")


def factor(of: Column) -> float:
    """What a value in SI is multiplied by to be shown."""
    return _SHOWN.get(of.name, (1.0, ""))[0]


def unit(of: Column) -> str:
    """The unit a value is shown in; empty for a number without one."""
    known = _SHOWN[of.name][1] if of.name in _SHOWN else of.unit
    return "" if known == "1" else known.replace("*", "·")


def heading(of: Column) -> str:
    """Label of an axis or of a table's column: name and unit."""
    return f"{of.label}, {unit(of)}" if unit(of) else of.label


def number(of: Column, value: float, digits: int = 4) -> str:
    """A value (SI) without its unit; gains and rates to the unit, others to so many digits."""
    shown = value * factor(of)
    if of.unit in _SIGNED:
        return signed(shown) if abs(shown) >= 10.0 or shown == round(shown) else signed(shown, 1)
    return f"{shown:.{digits}g}".replace("-", "\N{MINUS SIGN}")


def quantity(of: Column, value: float, digits: int = 4) -> str:
    """A value (SI) with its unit."""
    return f"{number(of, value, digits)} {unit(of)}".rstrip()


def setting(of: Column, value: float) -> str:
    """A column and its value with unit, for a sentence: ``spring rate −5715 N/m``."""
    return f"{of.label} {quantity(of, value)}"


def settings(fixed: dict[str, float]) -> str:
    """Several columns and their values, by name."""
    return ", ".join(setting(BY_NAME[name], value) for name, value in fixed.items())
