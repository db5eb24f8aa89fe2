"""Read MASK4 gain matrices and classify every auxiliary row.

The reader recognises and reports the load row, the hold row, the doubled rows at a change of the
spring rate and the end mark. None of them is ever among the rows that are commanded.
"""

from pathlib import Path
from typing import NamedTuple

from rig.config.problems import ConfigError, Problem, format_line_numbers, format_number
from rig.interop.legacy import mask4_rows
from rig.interop.legacy.columns import (
    KP,
    MASK4,
    REQUIRED,
    SPRING,
    names_from_header,
    names_from_list,
)
from rig.interop.legacy.mask4_rows import RowRoles, RowValues, UnknownLeadRowsError
from rig.interop.legacy.matrix import GainMatrix, MatrixLocation, select_columns
from rig.interop.legacy.table import SKIPPED, Table, read_table, to_numbers


class Mask4Matrix(NamedTuple):
    """A MASK4 gain matrix, and the auxiliary rows and remarks of its file."""

    path: Path
    columns: tuple[str, ...]  # of the file, by today's names
    columns_from: str  # source of the column names: header, or list
    matrix: GainMatrix  # the rows to be measured
    location: MatrixLocation
    roles: RowRoles  # role of each row of the file
    lines: tuple[int, ...]  # line of the file of each of its rows
    remarks: tuple[str, ...]  # findings that a person should check


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
    table = read_table(path, sheet, variable)
    names, columns_from = _columns(table, columns)
    values = to_numbers(table, names)
    lines = tuple(row.line for row in table.rows)
    kp_column, spring_column = names.index(KP), names.index(SPRING)
    try:
        roles = mask4_rows.classify_rows(values, kp_column, spring_column, lead_rows)
    except UnknownLeadRowsError:
        message = (
            "the second row is no copy of the third, so the rows that only load the set are "
            "unknown; give the number of rows before the first measured one, as in --lead-rows 2"
        )
        raise ConfigError([table.problem(lines[0], 0, "", None, message)]) from None
    if not roles.measured:
        message = "no row to be measured before the end mark"
        raise ConfigError([table.problem(lines[0], 0, "", None, message)])
    matrix = select_columns(names, (values[i] for i in roles.measured))
    location = MatrixLocation(
        table,
        tuple(lines[i] for i in roles.measured),
        tuple(names.index(name) + 1 for name in matrix.columns),
    )
    remarks = tuple(_remarks(roles, lines, values, kp_column, spring_column))
    kept = tuple(name for name in names if name != SKIPPED)
    return Mask4Matrix(Path(path), kept, columns_from, matrix, location, roles, lines, remarks)


def _columns(table: Table, given: str | None) -> tuple[tuple[str, ...], str]:
    if table.header is None and given is None:
        message = (
            "the file has no header, and the column order of the MASK4 files is unpublished; "
            "list the columns, as in --columns Kp,Ki,springK"
        )
        raise ConfigError([table.problem(1, 0, "columns", None, message)])
    if given is None:
        assert table.header is not None
        names, problems = names_from_header(table, table.header, MASK4, REQUIRED)
        columns_from = "header"
    else:
        names, problems = names_from_list(table, given, MASK4, REQUIRED)
        columns_from = "list"
        if not problems and table.header is not None:
            problems = _disagreements(table, names)
    if problems:
        raise ConfigError(problems)
    return names, columns_from


def _disagreements(table: Table, names: tuple[str, ...]) -> list[Problem]:
    """Return a problem for each column that a readable header and the list name differently."""
    assert table.header is not None
    header, unread = names_from_header(table, table.header, MASK4, ())
    if unread:
        return []  # unknown names contradict nothing
    line = table.header.line
    return [
        table.problem(
            line, i, "columns", in_header, f"the header says {in_header}, the list {in_list}"
        )
        for i, (in_header, in_list) in enumerate(zip(header, names, strict=False), start=1)
        if SKIPPED not in (in_header, in_list) and in_header != in_list
    ]


def _remarks(
    roles: RowRoles, lines: tuple[int, ...], values: tuple[RowValues, ...], kp: int, spring: int
) -> list[str]:
    remarks = []
    for i in roles.not_doubled:
        remarks.append(
            f"line {lines[i]}: the spring rate changes to {format_number(values[i][spring])} N/m "
            "and "
            "the row occurs only once: the stator had no time to move"
        )
    for i in roles.repeated:
        remarks.append(
            f"line {lines[i]}: equal to the row before, with no change of the spring rate"
        )
    if roles.end is None:
        remarks.append("no end mark (Kp = -999): the old scripts took data to the end of the file")
    if roles.after_end:
        after = [lines[i] for i in roles.after_end]
        which = format_line_numbers(after)
        remarks.append(f"rows after the end mark: {len(after)} ({which}), never reached, left out")
    driving = [lines[i] for i in roles.measured if values[i][kp] > 0.0]
    if driving:
        remarks.append(f"Kp > 0 drives the body, line {', '.join(map(str, driving))}")
    return remarks
