"""MASK4 gain matrices, read with every auxiliary row accounted for.

The load row, the hold row, the doubled rows at a change of the spring rate and the end mark are
recognised and reported. None of them is ever among the rows that are commanded.
"""

from pathlib import Path
from typing import NamedTuple

from rig.config.problems import ConfigError, Problem, format_line_numbers, format_number
from rig.interop.legacy import mask4_rows
from rig.interop.legacy.columns import KP, MASK4, NEEDED, SPRING, by_header, by_list
from rig.interop.legacy.mask4_rows import Found, UnknownLeadError, Values
from rig.interop.legacy.matrix import Matrix, Place, ordered
from rig.interop.legacy.table import SKIPPED, Table, numbers, read_table


class Mask4(NamedTuple):
    """A MASK4 gain matrix and what its file holds besides."""

    path: Path
    columns: tuple[str, ...]  # of the file, by today's names
    said_by: str  # who said what the columns are: header, or list
    matrix: Matrix  # the rows to be measured
    place: Place
    found: Found  # what each row of the file is
    lines: tuple[int, ...]  # of the file, one for each of its rows
    remarks: tuple[str, ...]  # what a person should look at


def read(
    path: Path,
    columns: str | None = None,
    lead_rows: int | None = None,
    *,
    sheet: str | None = None,
    variable: str | None = None,
) -> Mask4:
    """A gain matrix from a CSV, a workbook or a MATLAB file.

    ``columns``: names in the order of the file (`-` for one to leave out), needed where the file
    has no header. ``lead_rows``: rows before the first one to be measured, needed where the second
    row is no copy of the third. Raises `ConfigError` with every problem.
    """
    table = read_table(path, sheet, variable)
    names, said_by = _columns(table, columns)
    values = numbers(table, names)
    lines = tuple(row.line for row in table.rows)
    at_kp, at_spring = names.index(KP), names.index(SPRING)
    try:
        found = mask4_rows.structure(values, at_kp, at_spring, lead_rows)
    except UnknownLeadError:
        message = (
            "the second row is no copy of the third, so it cannot be told which rows only load "
            "the set; say how many stand before the first measured one, as in --lead-rows 2"
        )
        raise ConfigError([table.problem(lines[0], 0, "", None, message)]) from None
    if not found.rows:
        message = "no row to be measured before the end mark"
        raise ConfigError([table.problem(lines[0], 0, "", None, message)])
    matrix = ordered(names, (values[i] for i in found.rows))
    place = Place(
        table,
        tuple(lines[i] for i in found.rows),
        tuple(names.index(name) + 1 for name in matrix.columns),
    )
    remarks = tuple(_remarks(found, lines, values, at_kp, at_spring))
    kept = tuple(name for name in names if name != SKIPPED)
    return Mask4(Path(path), kept, said_by, matrix, place, found, lines, remarks)


def _columns(table: Table, given: str | None) -> tuple[tuple[str, ...], str]:
    if table.header is None and given is None:
        message = (
            "the file has no header, and the column order of the MASK4 files is unpublished; "
            "list the columns, as in --columns Kp,Ki,springK"
        )
        raise ConfigError([table.problem(1, 0, "columns", None, message)])
    if given is None:
        assert table.header is not None
        names, problems = by_header(table, table.header, MASK4, NEEDED)
        said_by = "header"
    else:
        names, problems = by_list(table, given, MASK4, NEEDED)
        said_by = "list"
        if not problems and table.header is not None:
            problems = _disagreements(table, names)
    if problems:
        raise ConfigError(problems)
    return names, said_by


def _disagreements(table: Table, names: tuple[str, ...]) -> list[Problem]:
    """Where a header that can be read says otherwise than the list."""
    assert table.header is not None
    header, unread = by_header(table, table.header, MASK4, ())
    if unread:
        return []  # names we do not know contradict nothing
    line = table.header.line
    return [
        table.problem(line, i, "columns", said, f"the header says {said}, the list {listed}")
        for i, (said, listed) in enumerate(zip(header, names, strict=False), start=1)
        if SKIPPED not in (said, listed) and said != listed
    ]


def _remarks(
    found: Found, lines: tuple[int, ...], values: tuple[Values, ...], kp: int, spring: int
) -> list[str]:
    said = []
    for i in found.undoubled:
        said.append(
            f"line {lines[i]}: the spring rate changes to {format_number(values[i][spring])} N/m and "
            "the row stands only once: there was no time for the stator to move"
        )
    for i in found.repeated:
        said.append(f"line {lines[i]}: equal to the row before, with no change of the spring rate")
    if found.end is None:
        said.append("no end mark (Kp = -999): the old scripts took data to the end of the file")
    if found.after:
        after = [lines[i] for i in found.after]
        which = format_line_numbers(after)
        said.append(f"rows after the end mark: {len(after)} ({which}), never reached, left out")
    driving = [lines[i] for i in found.rows if values[i][kp] > 0.0]
    if driving:
        said.append(f"Kp > 0 drives the body, line {', '.join(map(str, driving))}")
    return said
