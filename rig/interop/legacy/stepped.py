"""Gain matrices of the LUPA, WEC-Bench and FOSWEC rigs: stiffness and damping, one row per step.

Public repositories PMEC-OSU/LUPA, /WEC-Bench and /FOSWEC2. Their Simulink block selects a row by

    idx = ceil(time / GainTstep);  while idx > nrows, idx = idx - nrows;  end

with GainTstep = numPeriods * wavePeriod. It has two traps, which `played_row`
reproduces: at time 0 the index is 0, outside MATLAB's range; after the last row the block starts
again with the first one, for ever.
"""

import math
from pathlib import Path
from typing import NamedTuple

from rig.config.problems import ConfigError
from rig.interop.legacy.columns import FOSWEC, LUPA, Column, names_from_header, names_from_list
from rig.interop.legacy.table import SKIPPED, Table, read_table, to_numbers

STYLES: dict[str, tuple[Column, ...]] = {"lupa": LUPA, "foswec": FOSWEC}
"""Columns of each style, in the order of its files; WEC-Bench files are of style `lupa`."""


class SteppedMatrix(NamedTuple):
    """A gain matrix of equal steps: feedback gains in the signs of its file."""

    path: Path
    style: str
    columns: tuple[str, ...]
    columns_from: str  # source of the column names: header, list, or style
    table: Table
    rows: tuple[tuple[float, ...], ...]  # all rows of the file
    zero_rows_before: int  # before the first gain
    zero_rows_after: int  # after the last gain
    lines: tuple[int, ...]  # line of the file of each row
    remarks: tuple[str, ...]

    @property
    def active(self) -> range:
        """Indices of the rows from the first gain to the last."""
        return range(self.zero_rows_before, len(self.rows) - self.zero_rows_after)


class PlayedRow(NamedTuple):
    """The row that the Simulink block plays at an instant."""

    row: int  # from 1; 0 is the block's index at time 0, which is out of range
    lap: int  # number of completed passes


def played_row(time: float, step: float, count: int) -> PlayedRow:
    """Return the row that the block plays at ``time`` (s), for ``count`` rows of ``step`` (s) each.

    The block plays a row up to and including the instant at which the next one is due.
    """
    index, lap = math.ceil(time / step), 0
    while index > count:
        index -= count
        lap += 1
    return PlayedRow(index, lap)


def read(
    path: Path,
    style: str,
    columns: str | None = None,
    *,
    sheet: str | None = None,
    variable: str | None = None,
) -> SteppedMatrix:
    """Read a gain matrix of style ``style``: `lupa` (two columns) or `foswec` (eight).

    Without header or ``columns`` the column order is that of the style. Rows of zeros at both ends
    are counted separately. Raises `ConfigError` with every problem.
    """
    known = STYLES[style]
    needed = tuple(column.name for column in known)
    table = read_table(path, sheet, variable)
    if columns is not None:
        names, problems = names_from_list(table, columns, known, needed)
        columns_from = "list"
    elif table.header is not None:
        names, problems = names_from_header(table, table.header, known, needed)
        columns_from = "header"
    else:
        names, problems, columns_from = needed, [], "style"
    if problems:
        raise ConfigError(problems)
    values = to_numbers(table, names)
    indices = [names.index(name) for name in needed]
    rows = tuple(tuple(row[i] for i in indices) for row in values)
    nonzero = [i for i, row in enumerate(rows) if any(row)]
    lines = tuple(row.line for row in table.rows)
    if not nonzero:
        raise ConfigError([table.problem(lines[0], 0, "", None, "all gains are zero")])
    remarks = [
        f"line {lines[i]}: all gains are zero between rows with gains; kept as a row"
        for i in range(nonzero[0], nonzero[-1])
        if not any(rows[i])
    ]
    if len(rows) < len(needed):
        remarks.append(
            f"{len(rows)} rows and {len(needed)} columns: MATLAB's length() gives the larger, "
            "so a block that uses it runs beyond the last row"
        )
    if SKIPPED in names:
        remarks.append(f"{names.count(SKIPPED)} columns left out")
    zero_rows_after = len(rows) - 1 - nonzero[-1]
    return SteppedMatrix(
        Path(path),
        style,
        needed,
        columns_from,
        table,
        rows,
        nonzero[0],
        zero_rows_after,
        lines,
        tuple(remarks),
    )


def cell_column(matrix: SteppedMatrix, name: str) -> int:
    """Return the file's column (from 1) that holds ``name``; 0 unless the style gave the names."""
    return matrix.columns.index(name) + 1 if matrix.columns_from == "style" else 0
