"""A gain matrix as the rig has it: named columns in house units and signs, rows to be measured."""

import math
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from rig.config.columns import END_MARK
from rig.config.matrix import Combination
from rig.config.problems import ConfigError, Problem, display_path, format_number
from rig.config.ranges import allowed_values
from rig.interop.legacy.columns import KI, KP, MASK4, NEEDED, SPRING, by_header
from rig.interop.legacy.table import Table, numbers, read_table

ORDER = tuple(column.name for column in MASK4)


class Matrix(NamedTuple):
    """Columns in the order of `ORDER`, the first three always; F = Kp v + Ki x on the body."""

    columns: tuple[str, ...]
    rows: tuple[tuple[float, ...], ...]


class Place(NamedTuple):
    """Where a matrix comes from."""

    table: Table
    lines: tuple[int, ...]  # of the file, one a row
    positions: tuple[int, ...]  # column of the file, from 1, one a column; 0 for none


def ordered(names: tuple[str, ...], rows: Iterable[tuple[float, ...]]) -> Matrix:
    """Rows of columns in any order as a matrix; columns of other names are left out."""
    columns = tuple(name for name in ORDER if name in names)
    at = [names.index(name) for name in columns]
    return Matrix(columns, tuple(tuple(row[i] for i in at) for row in rows))


def problems(matrix: Matrix, place: Place | None = None, path: Path | None = None) -> list[Problem]:
    """Every value that a campaign refuses, told where it stands in the file it came from."""
    found = []
    for i, row in enumerate(matrix.rows):
        for j, (name, value) in enumerate(zip(matrix.columns, row, strict=True)):
            message = _refusal(name, value)
            if not message:
                continue
            if place is not None:
                line, column = place.lines[i], place.positions[j]
                found.append(place.table.problem(line, column, name, value, message))
            else:
                found.append(
                    Problem(display_path(path or Path("matrix")), i + 1, name, value, message)
                )
    return found


def _refusal(name: str, value: float) -> str:
    if not math.isfinite(value):
        return f"{format_number(value)} is not a finite number"
    if name == KP and value == END_MARK:
        return "-999 ends a matrix and is never a gain"
    if name == "discharge_level" and value not in range(16):
        return f"{format_number(value)} is out of range; allowed a 4-bit mask, whole 0 .. 15"
    known = allowed_values(Combination, (name,))
    if known is not None and not known.contains(value):
        reason = f" ({known.reason()})" if known.reason() else ""
        return f"{format_number(value)} is out of range; allowed {known.description(name)}{reason}"
    return ""


def plain(value: float) -> str:
    """A number that reads back to the same bits, whole ones without a point."""
    text = repr(value)
    return text.removesuffix(".0")


def csv_text(matrix: Matrix, notes: Iterable[str] = ()) -> str:
    """Today's CSV matrix; ``notes`` become comment lines above the header."""
    lines = [f"# {note}" for note in notes]
    lines.append(",".join(matrix.columns))
    lines += [",".join(plain(value) for value in row) for row in matrix.rows]
    return "\n".join(lines) + "\n"


def read_csv(path: Path) -> tuple[Matrix, tuple[int, ...]]:
    """Today's CSV matrix up to its end mark, and the lines behind that. Raises `ConfigError`."""
    table = read_table(path)
    house = tuple(column._replace(legacy=column.name, others=()) for column in MASK4)
    if table.header is None:
        message = f"no header; allowed {','.join(NEEDED)} and more columns of a campaign"
        raise ConfigError([table.problem(1, 0, "", None, message)])
    names, wrong = by_header(table, table.header, house, NEEDED)
    if wrong:
        raise ConfigError(wrong)
    matrix = ordered(names, numbers(table, names))
    at = matrix.columns.index(KP)
    ends = [i for i, row in enumerate(matrix.rows) if row[at] == END_MARK]
    rows = matrix.rows[: ends[0]] if ends else matrix.rows
    if not rows:
        raise ConfigError([table.problem(table.rows[0].line, 0, "", None, "no row before the end")])
    after = table.rows[ends[0] + 1 :] if ends else ()
    return matrix._replace(rows=rows), tuple(row.line for row in after)


def campaign_text(matrix: Matrix, base: str, name: str, more: Iterable[str] = ()) -> str:
    """A campaign file that takes everything but its matrix from ``base``; ``more`` are its lines.

    The matrix replaces any kind of matrix of the base.
    """
    entries = (
        ", ".join(f"{n}: {plain(v)}" for n, v in zip(matrix.columns, row, strict=True))
        for row in matrix.rows
    )
    lines = [f"extends: {base}", f"name: {name}", *more, "matrix:", "  grid:", "  csv:", "  list:"]
    return "\n".join([*lines, *(f"    - {{{entry}}}" for entry in entries)]) + "\n"


def words(matrix: Matrix) -> str:
    """How many rows and how many values of each of the three main columns, in a line."""
    counts = {
        name: len({row[matrix.columns.index(name)] for row in matrix.rows})
        for name in (SPRING, KP, KI)
    }
    rates, kps, kis = counts.values()
    rows = len(matrix.rows)
    return f"{_many(rows, 'row')}, {_many(rates, 'spring rate')}, {kps} x Kp, {kis} x Ki"


def _many(count: int, thing: str) -> str:
    return f"{count} {thing}{'s' if count != 1 else ''}"
