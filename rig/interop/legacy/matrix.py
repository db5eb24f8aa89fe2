"""Gain matrices of the rig: named columns in house units and signs, rows to be measured."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from controllers import impedance
from rig.config.columns import END_MARK
from rig.config.matrix import combination_model
from rig.config.problems import ConfigError, Problem, display_path, format_number
from rig.config.ranges import allowed_values
from rig.interop.legacy.columns import KI, KP, MASK4, REQUIRED, SPRING, names_from_header
from rig.interop.legacy.table import Table, read_table, to_numbers

COLUMN_ORDER = tuple(column.name for column in MASK4)


class GainMatrix(NamedTuple):
    """Columns in the order of `ORDER`, the first three always; F = Kp v + Ki x on the body."""

    columns: tuple[str, ...]
    rows: tuple[tuple[float, ...], ...]


class MatrixLocation(NamedTuple):
    """Location of a matrix in its file."""

    table: Table
    lines: tuple[int, ...]  # line of the file of each row
    positions: tuple[int, ...]  # column of the file (from 1) of each column; 0 if none


def select_columns(names: tuple[str, ...], rows: Iterable[tuple[float, ...]]) -> GainMatrix:
    """Return rows with columns in any order as a matrix; columns of other names are left out."""
    columns = tuple(name for name in COLUMN_ORDER if name in names)
    indices = [names.index(name) for name in columns]
    return GainMatrix(columns, tuple(tuple(row[i] for i in indices) for row in rows))


def matrix_problems(
    matrix: GainMatrix, location: MatrixLocation | None = None, path: Path | None = None
) -> list[Problem]:
    """Return a problem for every value that a campaign refuses, located in the source file."""
    problems = []
    for i, row in enumerate(matrix.rows):
        for j, (name, value) in enumerate(zip(matrix.columns, row, strict=True)):
            message = _value_problem(name, value)
            if not message:
                continue
            if location is not None:
                line, column = location.lines[i], location.positions[j]
                problems.append(location.table.problem(line, column, name, value, message))
            else:
                problems.append(
                    Problem(display_path(path or Path("matrix")), i + 1, name, value, message)
                )
    return problems


def _value_problem(name: str, value: float) -> str:
    if not math.isfinite(value):
        return f"{format_number(value)} is not a finite number"
    if name == KP and value == END_MARK:
        return "-999 ends a matrix and is never a gain"
    if name == "discharge_level" and value not in range(16):
        return f"{format_number(value)} is out of range; allowed a 4-bit mask, whole 0 .. 15"
    limits = allowed_values(combination_model(impedance.COLUMNS), (name,))
    if limits is not None and not limits.contains(value):
        reason = f" ({limits.reason()})" if limits.reason() else ""
        return f"{format_number(value)} is out of range; allowed {limits.description(name)}{reason}"
    return ""


def exact_text(value: float) -> str:
    """Return a number as text that reads back to the same bits, whole numbers without a point."""
    text = repr(value)
    return text.removesuffix(".0")


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
    house_columns = tuple(column._replace(legacy=column.name, aliases=()) for column in MASK4)
    if table.header is None:
        message = f"no header; allowed {','.join(REQUIRED)} and more columns of a campaign"
        raise ConfigError([table.problem(1, 0, "", None, message)])
    names, problems = names_from_header(table, table.header, house_columns, REQUIRED)
    if problems:
        raise ConfigError(problems)
    matrix = select_columns(names, to_numbers(table, names))
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
    entries = (
        ", ".join(f"{n}: {exact_text(v)}" for n, v in zip(matrix.columns, row, strict=True))
        for row in matrix.rows
    )
    lines = [
        f"extends: {base}",
        f"name: {name}",
        *extra_lines,
        "matrix:",
        "  grid:",
        "  csv:",
        "  list:",
    ]
    return "\n".join([*lines, *(f"    - {{{entry}}}" for entry in entries)]) + "\n"


def summary(matrix: GainMatrix) -> str:
    """Return the number of rows, and of values of the three main columns, as one line."""
    counts = {
        name: len({row[matrix.columns.index(name)] for row in matrix.rows})
        for name in (SPRING, KP, KI)
    }
    rates, kps, kis = counts.values()
    rows = len(matrix.rows)
    return f"{_count(rows, 'row')}, {_count(rates, 'spring rate')}, {kps} x Kp, {kis} x Ki"


def _count(count: int, thing: str) -> str:
    return f"{count} {thing}{'s' if count != 1 else ''}"
