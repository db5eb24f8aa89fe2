"""A table in a CSV, a spreadsheet or a MATLAB file, as cells that know where they stand.

Nothing is guessed: a file with several sheets or matrices must be told which one, and a cell that
is no number stays what it is until somebody who knows the columns refuses it.
"""

import csv
import io
import math
import re
import warnings
import zipfile
import zlib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import ParseError

from rig.config.problems import ConfigError, Problem, display_path, format_value
from rig.interop.legacy import matlab
from rig.regular_file import MAX_TABLE_BYTES, read_regular

MOST_ROWS = 10_000
MOST_COLUMNS = 100
SUFFIXES = (".csv", ".txt", ".xlsx", ".mat")

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_NOT_FINITE = re.compile(r"[+-]?(nan|inf(inity)?)", re.IGNORECASE)
_COMMENTS = ("#", "%")


class Row(NamedTuple):
    """One row that holds something, or stands before one that does."""

    line: int  # line of the file, row of the sheet or of the matrix; from 1
    cells: tuple[object, ...]  # float, text, None where blank, or what else a spreadsheet holds


class Table(NamedTuple):
    """A header, if there is one, and the rows below it."""

    path: Path
    header: Row | None
    rows: tuple[Row, ...]

    def problem(self, line: int, column: int, name: str, value: object, message: str) -> Problem:
        """A problem of a cell; ``column`` from 1, 0 for the whole row."""
        return Problem(display_path(self.path), line, name, value, message, column)


def read_table(path: Path, sheet: str | None = None, variable: str | None = None) -> Table:
    """The table of a file: ``sheet`` of a workbook, ``variable`` of a MATLAB file.

    A first row without any number is the header. Raises `ConfigError` if the file cannot be read,
    or holds several tables and none is named.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        raise _refused(path, f"{path.suffix!r} is not read; allowed {', '.join(SUFFIXES)}")
    for name, given, of in (("sheet", sheet, ".xlsx"), ("variable", variable, ".mat")):
        if given is not None and kind != of:
            raise _refused(path, f"a {name} is named, but only {of} files have one")
    try:
        data = read_regular(path, MAX_TABLE_BYTES)
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise _refused(path, f"cannot be read: {reason}") from None
    if kind == ".xlsx":
        header, rows = None, _sheet(path, data, sheet)
    elif kind == ".mat":
        header, rows = _matrix(path, data, variable)
    else:
        header, rows = None, _text(path, data)
    while rows and not any(cell is not None for cell in rows[-1].cells):
        rows.pop()
    if header is None and rows and not any(isinstance(cell, float) for cell in rows[0].cells):
        header, *rows = rows
    return Table(path, header, tuple(rows))


SKIPPED = "-"
"""Name of a column that is not read; it may hold anything, and its number is 0."""


def numbers(table: Table, names: tuple[str, ...]) -> tuple[tuple[float, ...], ...]:
    """The rows as finite numbers, one for each of ``names``.

    Raises `ConfigError` with every blank, text and non-finite cell and every wrong count, each
    with its line, column and value.
    """
    found, problems = [], list[Problem]()
    for line, cells in table.rows:
        if not any(cell is not None for cell in cells):
            problems.append(table.problem(line, 0, "", None, "the row is blank"))
            continue
        given = list(cells)
        while len(given) > len(names) and given[-1] is None:
            given.pop()
        if len(given) != len(names):
            message = f"{len(given)} cells; allowed {len(names)}: {', '.join(names)}"
            problems.append(table.problem(line, 0, "", None, message))
            continue
        bad = [
            table.problem(line, i, name, cell, message)
            for i, (name, cell) in enumerate(zip(names, given, strict=True), start=1)
            if name != SKIPPED and (message := wrong(cell))
        ]
        problems += bad
        if not bad:
            read = zip(names, given, strict=True)
            found.append(tuple(0.0 if n == SKIPPED else float(str(cell)) for n, cell in read))
    if problems:
        raise ConfigError(problems)
    if not found:
        raise _refused(table.path, "no row of numbers")
    return tuple(found)


def wrong(cell: object) -> str:
    """Why a cell is no finite number; empty if it is one."""
    if cell is None:
        return "blank; allowed a number (a formula that was never calculated is blank too)"
    if not isinstance(cell, float):
        return f"{format_value(cell)} is not a number"
    if not math.isfinite(cell):
        return f"{format_value(cell)} is not a finite number"
    return ""


def _refused(path: Path, message: str) -> ConfigError:
    return ConfigError([Problem(display_path(path), 1, "", None, message)])


def _bounded(path: Path, rows: Iterable[Row]) -> list[Row]:
    kept: list[Row] = []
    for row in rows:
        if len(kept) >= MOST_ROWS:
            raise _refused(path, f"more than {MOST_ROWS} rows; allowed at most {MOST_ROWS}")
        kept.append(row)
    return kept


def _text(path: Path, data: bytes) -> list[Row]:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise _refused(path, f"the file is not UTF-8 text (byte {error.start})") from None
    lines = [
        "" if line.lstrip().startswith(_COMMENTS) else line
        for line in text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    ]
    for number, line in enumerate(lines, start=1):
        for mark, name in ((";", "semicolons"), ("\t", "tabs")):
            if mark in line and "," not in line:
                message = f"the cells are separated by {name}; allowed commas"
                raise ConfigError([Problem(display_path(path), number, "", line, message)])
    reader = csv.reader(io.StringIO("\n".join(lines)), skipinitialspace=True)
    try:
        return _bounded(
            path,
            (
                Row(reader.line_num, tuple(_cell(cell) for cell in cells[:MOST_COLUMNS]))
                for cells in reader
                if cells
            ),
        )
    except csv.Error as error:
        raise ConfigError(
            [Problem(display_path(path), reader.line_num, "", None, str(error))]
        ) from None


def _cell(text: str) -> object:
    text = text.strip()
    if not text:
        return None
    number = _NUMBER.fullmatch(text) or _NOT_FINITE.fullmatch(text)
    return float(text) if number else text


def _sheet(path: Path, data: bytes, name: str | None) -> list[Row]:
    import openpyxl  # noqa: PLC0415 - a third of a second, and most files are no workbooks
    from openpyxl.utils.exceptions import InvalidFileException  # noqa: PLC0415

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # it warns of styles and extensions it does not know
        try:
            book = openpyxl.load_workbook(io.BytesIO(data), data_only=True, read_only=True)
            sheets = {sheet.title: sheet for sheet in book.worksheets}
            tables = {
                title: _bounded(path, _cells(sheet))
                for title, sheet in sheets.items()
                if name is None or title == name
            }
        except (
            *(zipfile.BadZipFile, InvalidFileException, ParseError, OSError, EOFError),
            *(KeyError, ValueError, TypeError, AttributeError, IndexError, zlib.error),
        ) as error:
            raise _refused(path, f"not readable as a workbook: {error}") from None
    if name is not None and name not in tables:
        raise _refused(path, f"no sheet {name!r}; there are {', '.join(sheets)}")
    full = {title: rows for title, rows in tables.items() if rows}
    if len(full) > 1:
        raise _refused(path, f"several sheets, name one: {', '.join(full)}")
    return next(iter(full.values()), [])


def _cells(sheet: Any) -> Iterable[Row]:
    blank: list[Row] = []
    begun = False
    for number, row in enumerate(sheet.iter_rows(values_only=True), start=1):
        here = Row(number, tuple(_value(cell) for cell in row[:MOST_COLUMNS]))
        if not any(cell is not None for cell in here.cells):
            if begun and len(blank) <= MOST_ROWS:
                blank.append(here)
            continue
        yield from blank  # blank rows count only between others
        blank, begun = [], True
        yield here


def _value(cell: object) -> object:
    if isinstance(cell, int | float) and not isinstance(cell, bool):
        return float(cell)
    if isinstance(cell, str):
        return cell.strip() or None
    return cell


def _matrix(path: Path, data: bytes, name: str | None) -> tuple[Row | None, list[Row]]:
    try:
        found = matlab.load(data)
    except ValueError as error:
        raise _refused(path, str(error)) from None
    full = {key: rows for key, rows in found.matrices.items() if name in (None, key)}
    if len(full) != 1:
        there = ", ".join(found.names) or "nothing"
        said = f"{len(full)} numeric matrices" if name is None else f"no numeric matrix {name!r}"
        message = f"{said} among {there}; name one (a MATLAB table is none: save table2array)"
        raise _refused(path, message)
    array = next(iter(full.values()))
    if len(array[0]) > MOST_COLUMNS:
        raise _refused(path, f"{len(array[0])} columns; allowed at most {MOST_COLUMNS}")
    names = found.texts.get("columns")
    header = Row(1, tuple(names)) if names else None
    return header, _bounded(path, (Row(i, tuple(row)) for i, row in enumerate(array, start=1)))
