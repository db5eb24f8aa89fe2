"""Read and write MASK4 gain matrices, and classify every auxiliary row.

MASK4 report (Sandia), 3.2.3: the first row is held for about 5 s and loads the set. The second row,
identical to the third, is held until 120 s. Where the spring rate changes, the new combination
occurs twice, the first time while the stator moves. Kp = -999 ends the matrix. The reader reports
these rows; none of them is ever among the rows that are commanded.
"""

import csv
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from rig.config.matrix import END_MARK, KindColumns
from rig.config.problems import (
    ConfigError,
    Problem,
    display_path,
    format_line_numbers,
    format_number,
)
from rig.interop.legacy.matrix import (
    KI,
    KP,
    MASK4,
    REQUIRED,
    SPRING,
    GainMatrix,
    NumberTable,
    exact_text,
    name_columns,
    refused_values,
    select_columns,
)
from rig.interop.legacy.table import SKIPPED, read_table

VARIABLE = "GainMatrix"
SUFFIXES = (".csv", ".xlsx", ".mat")

RowValues = tuple[float, ...]


class RowRoles(NamedTuple):
    """Indices (from 0) of a file's rows by their role."""

    measured: tuple[int, ...]  # rows to be measured
    lead: tuple[int, ...]  # before the first measured row: load row, hold row
    doubled: tuple[int, ...]  # held while the stator moves; each is repeated by the next row
    not_doubled: tuple[int, ...]  # measured at once after a change of the spring rate
    repeated: tuple[int, ...]  # measured, and equal to the measured row before
    end: int | None  # the row with Kp = -999
    after_end: tuple[int, ...]  # rows after the end mark, never played


class UnknownLeadRowsError(ValueError):
    """The number of rows before the first measured one is unknown."""


def classify_rows(
    rows: Sequence[RowValues], kp: int, spring: int, lead: int | None = None
) -> RowRoles:
    """Return the role of each row; ``kp`` and ``spring`` are the indices of those columns.

    ``lead`` is the number of rows before the first measured one. Without it, the second row must
    equal the third, as in the report; otherwise the function raises `UnknownLeadRowsError`.
    """
    end = next((i for i, row in enumerate(rows) if row[kp] == END_MARK), None)
    used = rows if end is None else rows[:end]
    if lead is None:
        if len(used) < 3 or used[1] != used[2]:
            raise UnknownLeadRowsError
        lead = 2
    measured, doubled, undoubled, repeated = [], list[int](), list[int](), list[int]()
    for i in range(lead, len(used)):
        changed = i > lead and used[i][spring] != used[i - 1][spring]
        if changed and i + 1 < len(used) and used[i + 1] == used[i]:
            doubled.append(i)
            continue
        if changed:
            undoubled.append(i)
        elif i > lead and used[i] == used[i - 1] and i - 1 not in doubled:
            repeated.append(i)
        measured.append(i)
    return RowRoles(
        measured=tuple(measured),
        lead=tuple(range(min(lead, len(used)))),
        doubled=tuple(doubled),
        not_doubled=tuple(undoubled),
        repeated=tuple(repeated),
        end=end,
        after_end=tuple(range(end + 1, len(rows))) if end is not None else (),
    )


def add_auxiliary_rows(
    rows: Sequence[RowValues], kp: int, ki: int, spring: int
) -> tuple[RowValues, ...]:
    """Return the rows with all auxiliary rows added; `classify_rows` recovers exactly ``rows``.

    No row may have Kp = -999. The load row differs from the first row, because the change loads
    the set; its Kp is never positive and never the end mark. The end row keeps the spring rate.
    """
    first, last = rows[0], rows[-1]
    if first[ki] != 0.0:
        load = _replaced(first, {ki: 0.0})
    else:
        load = _replaced(first, {kp: 0.0 if first[kp] != 0.0 else -1.0})
    complete = [load, first]
    before = first
    for row in rows:
        if row[spring] != before[spring]:
            complete.append(row)
        complete.append(row)
        before = row
    return (*complete, _replaced(last, {kp: END_MARK, ki: 0.0}))


def _replaced(row: RowValues, changed: dict[int, float]) -> RowValues:
    return tuple(changed.get(i, value) for i, value in enumerate(row))


class Mask4Matrix(NamedTuple):
    """A MASK4 gain matrix, and the auxiliary rows and remarks of its file."""

    path: Path
    file: NumberTable  # all rows of the file
    matrix: GainMatrix  # the rows to be measured
    roles: RowRoles  # role of each row of the file
    remarks: tuple[str, ...]  # findings that a person should check

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns of the file, by today's names."""
        return tuple(name for name in self.file.names if name != SKIPPED)

    def problems(self, matrix: GainMatrix, columns: KindColumns) -> list[Problem]:
        """Return a problem at its cell for every value of ``matrix`` that a campaign refuses.

        ``matrix`` holds the measured rows, as read or corrected; ``columns`` are the campaign's.
        """
        measured = self.roles.measured
        return [
            self.file.problem(measured[row], name, value, message)
            for row, name, value, message in refused_values(matrix, columns)
        ]


def read(
    path: Path,
    columns: str | None = None,
    lead_rows: int | None = None,
    *,
    sheet: str | None = None,
    variable: str | None = None,
) -> Mask4Matrix:
    """Read a gain matrix from a CSV, a workbook or a MATLAB file.

    ``columns`` lists names in the order of the file (`-` skips a column); a file without a header
    requires it. ``lead_rows`` is the number of rows before the first measured one; it is required
    if the second row is not a copy of the third. Raises `ConfigError` with every problem.
    """
    file = name_columns(read_table(path, sheet, variable), MASK4, REQUIRED, columns)
    kp, spring = file.names.index(KP), file.names.index(SPRING)
    try:
        roles = classify_rows(file.rows, kp, spring, lead_rows)
        message = "" if roles.measured else "no row to be measured before the end mark"
    except UnknownLeadRowsError:
        message = (
            "the second row is no copy of the third, so the rows that only load the set are "
            "unknown; give the number of rows before the first measured one, as in --lead-rows 2"
        )
    if message:
        raise ConfigError([file.table.problem(file.lines[0], 0, "", None, message)])
    matrix = select_columns(file.names, (file.rows[i] for i in roles.measured))
    return Mask4Matrix(Path(path), file, matrix, roles, tuple(_remarks(roles, file, kp, spring)))


def _remarks(roles: RowRoles, file: NumberTable, kp: int, spring: int) -> list[str]:
    lines = file.lines
    remarks = [
        f"line {lines[i]}: the spring rate changes to {format_number(file.rows[i][spring])} N/m "
        "and the row occurs only once: the stator had no time to move"
        for i in roles.not_doubled
    ]
    remarks += [
        f"line {lines[i]}: equal to the row before, with no change of the spring rate"
        for i in roles.repeated
    ]
    if roles.end is None:
        remarks.append("no end mark (Kp = -999): the old scripts took data to the end of the file")
    if roles.after_end:
        which = format_line_numbers([lines[i] for i in roles.after_end])
        count = len(roles.after_end)
        remarks.append(f"rows after the end mark: {count} ({which}), never reached, left out")
    driving = [lines[i] for i in roles.measured if file.rows[i][kp] > 0.0]
    if driving:
        remarks.append(f"Kp > 0 drives the body, line {', '.join(map(str, driving))}")
    return remarks


def write(path: Path, matrix: GainMatrix, columns: KindColumns, *, header: bool = True) -> int:
    """Write a matrix as CSV, workbook or MATLAB file and return its number of rows.

    The file has load row, hold row, doubled rows and end mark; columns are Kp, Ki, springK, then
    all others; `read` returns the same matrix again. A MATLAB file holds
    the numbers as `GainMatrix` and, unless ``header`` is false, their names as `columns`. Raises
    `ConfigError` for values that a campaign with these ``columns`` refuses, OSError if the file
    cannot be written.
    """
    path = Path(path)
    problems = [
        Problem(display_path(path), row + 1, name, value, message)
        for row, name, value, message in refused_values(matrix, columns)
    ]
    if not matrix.rows:
        problems.append(Problem(display_path(path), 1, "", None, "no row to write"))
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        message = f"{path.suffix!r} is not written; allowed {', '.join(SUFFIXES)}"
        problems.append(Problem(display_path(path), 1, "", None, message))
    if problems:
        raise ConfigError(problems)
    order = (KP, KI, SPRING, *(name for name in matrix.columns if name not in REQUIRED))
    indices = [matrix.columns.index(name) for name in order]
    rows = add_auxiliary_rows(
        [tuple(row[i] for i in indices) for row in matrix.rows], kp=0, ki=1, spring=2
    )
    legacy = {column.name: column.legacy for column in MASK4}
    names = [legacy[name] for name in order] if header else []
    if kind == ".csv":
        _write_text(path, names, rows)
    elif kind == ".xlsx":
        _write_sheet(path, names, rows)
    else:
        _write_matlab(path, names, rows)
    return len(rows)


def _write_text(path: Path, names: list[str], rows: tuple[RowValues, ...]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\r\n")
        if names:
            writer.writerow(names)
        writer.writerows([exact_text(value) for value in row] for row in rows)


def _write_sheet(path: Path, names: list[str], rows: tuple[RowValues, ...]) -> None:
    import openpyxl  # noqa: PLC0415 - a third of a second; most files are not workbooks
    from openpyxl.cell import WriteOnlyCell  # noqa: PLC0415

    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet(VARIABLE)
    if names:
        sheet.append(names)
    for row in rows:
        cells = []
        for value in row:
            # Text marked as a number keeps all digits; openpyxl writes floats with 16.
            cell = WriteOnlyCell(sheet, exact_text(value))
            cell.data_type = "n"
            cells.append(cell)
        sheet.append(cells)
    book.save(path)


def _write_matlab(path: Path, names: list[str], rows: tuple[RowValues, ...]) -> None:
    import numpy as np  # noqa: PLC0415
    from scipy.io import savemat  # noqa: PLC0415

    variables: dict[str, object] = {VARIABLE: np.array(rows, dtype=np.float64)}
    if names:
        variables["columns"] = np.array(names, dtype=object)
    with path.open("wb") as file:
        savemat(file, variables, do_compression=True)
