"""Gain matrices of the LUPA, WEC-Bench and FOSWEC rigs: stiffness and damping, one row a step.

Public repositories PMEC-OSU/LUPA, /WEC-Bench and /FOSWEC2. Their Simulink block takes a row by

    idx = ceil(time / GainTstep);  while idx > nrows, idx = idx - nrows;  end

with GainTstep = numPeriods * wavePeriod. Two traps follow, which `played` shows: at time 0 the
index is 0, out of MATLAB's range, and after the last row the first one comes again, for ever.
"""

import math
from pathlib import Path
from typing import NamedTuple

from rig.config.problems import ConfigError
from rig.interop.legacy.columns import FOSWEC, LUPA, Column, by_header, by_list
from rig.interop.legacy.table import SKIPPED, Table, numbers, read_table

STYLES: dict[str, tuple[Column, ...]] = {"lupa": LUPA, "foswec": FOSWEC}
"""Columns of each style, in the order of its files; WEC-Bench files are of style `lupa`."""


class Stepped(NamedTuple):
    """A gain matrix of equal steps as its file has it: gains of a feedback, in its own signs."""

    path: Path
    style: str
    columns: tuple[str, ...]
    said_by: str  # who said what the columns are: header, list, or style
    table: Table
    rows: tuple[tuple[float, ...], ...]  # all of the file
    before: int  # rows of zeros before the first gain
    behind: int  # rows of zeros after the last gain
    lines: tuple[int, ...]  # of the file, one a row
    remarks: tuple[str, ...]

    @property
    def active(self) -> range:
        """Indices of the rows from the first gain to the last."""
        return range(self.before, len(self.rows) - self.behind)


class Played(NamedTuple):
    """What the Simulink block plays at an instant."""

    row: int  # from 1; 0 is the block's index before the first row: out of range
    lap: int  # how often it has wrapped round


def played(time: float, step: float, count: int) -> Played:
    """The row at ``time`` (s) with steps of ``step`` (s) and ``count`` rows, as the block has it.

    A row is played up to and including the instant at which the next one is due.
    """
    index, lap = math.ceil(time / step), 0
    while index > count:
        index -= count
        lap += 1
    return Played(index, lap)


def read(
    path: Path,
    style: str,
    columns: str | None = None,
    *,
    sheet: str | None = None,
    variable: str | None = None,
) -> Stepped:
    """A gain matrix of style ``style``: `lupa` (two columns) or `foswec` (eight).

    Without header or ``columns`` the order is that of the style. Rows of zeros at both ends are
    counted apart. Raises `ConfigError` with every problem.
    """
    known = STYLES[style]
    needed = tuple(column.name for column in known)
    table = read_table(path, sheet, variable)
    if columns is not None:
        names, problems = by_list(table, columns, known, needed)
        said_by = "list"
    elif table.header is not None:
        names, problems = by_header(table, table.header, known, needed)
        said_by = "header"
    else:
        names, problems, said_by = needed, [], "style"
    if problems:
        raise ConfigError(problems)
    values = numbers(table, names)
    at = [names.index(name) for name in needed]
    rows = tuple(tuple(row[i] for i in at) for row in values)
    full = [i for i, row in enumerate(rows) if any(row)]
    lines = tuple(row.line for row in table.rows)
    if not full:
        raise ConfigError([table.problem(lines[0], 0, "", None, "all gains are zero")])
    remarks = [
        f"line {lines[i]}: all gains are zero between rows with gains; kept as a row"
        for i in range(full[0], full[-1])
        if not any(rows[i])
    ]
    if len(rows) < len(needed):
        remarks.append(
            f"{len(rows)} rows and {len(needed)} columns: MATLAB's length() gives the larger, "
            "so a block that uses it runs beyond the last row"
        )
    if SKIPPED in names:
        remarks.append(f"{names.count(SKIPPED)} columns left out")
    behind = len(rows) - 1 - full[-1]
    return Stepped(
        Path(path),
        style,
        needed,
        said_by,
        table,
        rows,
        full[0],
        behind,
        lines,
        tuple(remarks),
    )


def cell_column(found: Stepped, name: str) -> int:
    """Column of the file (from 1) that holds ``name``; 0 where a list or header reordered it."""
    return found.columns.index(name) + 1 if found.said_by == "style" else 0
