"""Gain matrices of the rig: named columns in house units and signs, rows to be measured."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from controllers import impedance
from rig.config.columns import END_MARK, KindColumns
from rig.config.matrix import combination_model
from rig.config.problems import ConfigError, format_number
from rig.config.ranges import allowed_values
from rig.interop.legacy.columns import KI, KP, MASK4, REQUIRED, SPRING, name_columns
from rig.interop.legacy.table import read_table

COLUMN_ORDER = tuple(column.name for column in MASK4)


class GainMatrix(NamedTuple):
    """Columns in the order of `ORDER`, the first three always; F = Kp v + Ki x on the body."""

    columns: tuple[str, ...]
    rows: tuple[tuple[float, ...], ...]


class RefusedValue(NamedTuple):
    """A value that a campaign refuses."""

    row: int  # from 0
    name: str
    value: float
    message: str


def select_columns(names: tuple[str, ...], rows: Iterable[tuple[float, ...]]) -> GainMatrix:
    """Return rows with columns in any order as a matrix; columns of other names are left out."""
    columns = tuple(name for name in COLUMN_ORDER if name in names)
    indices = [names.index(name) for name in columns]
    return GainMatrix(columns, tuple(tuple(row[i] for i in indices) for row in rows))


def refused_values(matrix: GainMatrix, columns: KindColumns) -> list[RefusedValue]:
    """Return every value of a matrix that a campaign with these columns refuses."""
    return [
        RefusedValue(i, name, value, message)
        for i, row in enumerate(matrix.rows)
        for name, value in zip(matrix.columns, row, strict=True)
        if (message := _value_problem(name, value, columns))
    ]


def _value_problem(name: str, value: float, columns: KindColumns) -> str:
    if not math.isfinite(value):
        return f"{format_number(value)} is not a finite number"
    if name == KP and value == END_MARK:
        return "-999 ends a matrix and is never a gain"
    if name == "discharge_level" and value not in range(16):
        return f"{format_number(value)} is out of range; allowed a 4-bit mask, whole 0 .. 15"
    limits = allowed_values(combination_model(columns, impedance.COLUMNS), (name,))
    if limits is not None and not limits.contains(value):
        reason = f" ({limits.reason()})" if limits.reason() else ""
        return f"{format_number(value)} is out of range; allowed {limits.description(name)}{reason}"
    return ""


def exact_text(value: float) -> str:
    """Return a number as text that reads back to the same bits, whole numbers without a point."""
    return repr(value).removesuffix(".0")


def format_csv(matrix: GainMatrix, comments: Iterable[str] = ()) -> str:
    """Return today's CSV matrix; ``comments`` become comment lines above the header."""
    lines = [f"# {note}" for note in comments]
    lines.append(",".join(matrix.columns))
    lines += [",".join(exact_text(value) for value in row) for row in matrix.rows]
    return "\n".join(lines) + "\n"


def read_csv(path: Path) -> tuple[GainMatrix, tuple[int, ...]]:
    """Read today's CSV matrix up to its end mark; return it and the line numbers after the mark.

    Raises `ConfigError` with every problem.
    """
    table = read_table(path)
    if table.header is None:
        message = f"no header; allowed {','.join(REQUIRED)} and more columns of a campaign"
        raise ConfigError([table.problem(1, 0, "", None, message)])
    house_columns = tuple(column._replace(legacy=column.name, aliases=()) for column in MASK4)
    numbers = name_columns(table, house_columns, REQUIRED)
    matrix = select_columns(numbers.names, numbers.rows)
    kp_column = matrix.columns.index(KP)
    ends = [i for i, row in enumerate(matrix.rows) if row[kp_column] == END_MARK]
    rows = matrix.rows[: ends[0]] if ends else matrix.rows
    if not rows:
        raise ConfigError([table.problem(table.rows[0].line, 0, "", None, "no row before the end")])
    after = table.rows[ends[0] + 1 :] if ends else ()
    return matrix._replace(rows=rows), tuple(row.line for row in after)


def format_campaign(
    matrix: GainMatrix, base: str, name: str, extra_lines: Iterable[str] = ()
) -> str:
    """Return a campaign file that takes everything but its matrix from ``base``.

    ``extra_lines`` are inserted before the matrix, which replaces any kind of matrix of the base.
    """
    lines = [f"extends: {base}", f"name: {name}", *extra_lines]
    lines += ["matrix:", "  grid:", "  csv:", "  list:"]
    for row in matrix.rows:
        cells = zip(matrix.columns, map(exact_text, row), strict=True)
        lines.append(f"    - {{{', '.join(f'{column}: {text}' for column, text in cells)}}}")
    return "\n".join(lines) + "\n"


def summary(matrix: GainMatrix) -> str:
    """Return the number of rows, and of values of the three main columns, as one line."""
    rates, kps, kis = (
        len({row[matrix.columns.index(name)] for row in matrix.rows}) for name in (SPRING, KP, KI)
    )
    rows = _count(len(matrix.rows), "row")
    return f"{rows}, {_count(rates, 'spring rate')}, {kps} x Kp, {kis} x Ki"


def _count(count: int, thing: str) -> str:
    return f"{count} {thing}{'s' if count != 1 else ''}"
