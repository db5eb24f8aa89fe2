"""Read a table from a CSV, a spreadsheet or a MATLAB file, with the line of every row.

Nothing is guessed: a file with several sheets or matrices requires the name of one, and a cell that
is not a number keeps its value until `to_numbers` refuses it.
"""

import csv
import io
import math
import re
import warnings
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree.ElementTree import ParseError

from rig.config.problems import ConfigError, Problem, display_path, format_value
from rig.interop.legacy import matlab
from rig.regular_file import MAX_TABLE_BYTES, read_regular

MAX_ROWS = 10_000
MAX_COLUMNS = 100
SUFFIXES = (".csv", ".txt", ".xlsx", ".mat")

_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_NOT_FINITE = re.compile(r"[+-]?(nan|inf(inity)?)", re.IGNORECASE)
_COMMENTS = ("#", "%")


class TableRow(NamedTuple):
    """A row that is not blank, or precedes one that is not."""

    line: int  # line of the file, row of the sheet or of the matrix; from 1
    cells: tuple[object, ...]  # float, text, None if blank, or another type of a spreadsheet


class Table(NamedTuple):
    """A header, if the file has one, and the rows below it."""

    path: Path
    header: TableRow | None
    rows: tuple[TableRow, ...]

    def problem(self, line: int, column: int, name: str, value: object, message: str) -> Problem:
        """Return a problem of a cell; ``column`` counts from 1, 0 means the whole row."""
        return Problem(display_path(self.path), line, name, value, message, column)


def read_table(path: Path, sheet: str | None = None, variable: str | None = None) -> Table:
    """Read the table of a file: ``sheet`` of a workbook, ``variable`` of a MATLAB file.

    A first row without any number is the header. Raises `ConfigError` if the file cannot be read,
    or if it holds several tables and none is named.
    """
    path = Path(path)
    kind = path.suffix.lower()
    if kind not in SUFFIXES:
        raise file_error(path, f"{path.suffix!r} is not read; allowed {', '.join(SUFFIXES)}")
    for name, given, suffix in (("sheet", sheet, ".xlsx"), ("variable", variable, ".mat")):
        if given is not None and kind != suffix:
            raise file_error(path, f"a {name} is named, but only {suffix} files have one")
    data = read_bytes(path)
    if kind == ".xlsx":
        header, rows = None, _read_sheet(path, data, sheet)
    elif kind == ".mat":
        header, rows = _read_matrix(path, data, variable)
    else:
        header, rows = None, _read_text(path, data)
    while rows and not any(cell is not None for cell in rows[-1].cells):
        rows.pop()
    if header is None and rows and not any(isinstance(cell, float) for cell in rows[0].cells):
        header, *rows = rows
    return Table(path, header, tuple(rows))


SKIPPED = "-"
"""Name of a skipped column: it may hold anything, and its number is 0."""


def to_numbers(table: Table, names: tuple[str, ...]) -> tuple[tuple[float, ...], ...]:
    """Return the rows as finite numbers, one for each of ``names``.

    Raises `ConfigError` with every blank, text and non-finite cell and every wrong number of cells,
    each with its line, column and value.
    """
    rows, problems = [], list[Problem]()
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
            if name != SKIPPED and (message := cell_problem(cell))
        ]
        problems += bad
        if not bad:
            read = zip(names, given, strict=True)
            rows.append(tuple(0.0 if n == SKIPPED else float(str(cell)) for n, cell in read))
    if problems:
        raise ConfigError(problems)
    if not rows:
        raise file_error(table.path, "no row of numbers")
    return tuple(rows)


def cell_problem(cell: object) -> str:
    """Return the reason why a cell is not a finite number; empty if it is one."""
    if cell is None:
        return "blank; allowed a number (a formula that was never calculated is blank too)"
    if not isinstance(cell, float):
        return f"{format_value(cell)} is not a number"
    if not math.isfinite(cell):
        return f"{format_value(cell)} is not a finite number"
    return ""


def file_error(path: Path, *messages: str) -> ConfigError:
    """Return an error with problems of a whole file."""
    return ConfigError(Problem(display_path(path), 1, "", None, message) for message in messages)


def read_bytes(path: Path) -> bytes:
    """Return the contents of a spreadsheet or table; raise `ConfigError` if it cannot be read."""
    try:
        return read_regular(path, MAX_TABLE_BYTES)
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise file_error(path, f"cannot be read: {reason}") from None


@contextmanager
def open_workbook(path: Path, data: bytes, *, read_only: bool = False) -> Iterator[Any]:
    """Open a workbook; in the context, damaged contents raise `ConfigError`.

    With ``read_only`` the sheets are read from ``data`` only as they are used.
    """
    import openpyxl  # noqa: PLC0415 - a third of a second; most files are not workbooks
    from openpyxl.utils.exceptions import InvalidFileException  # noqa: PLC0415

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # openpyxl warns of unknown styles and extensions
            yield openpyxl.load_workbook(io.BytesIO(data), data_only=True, read_only=read_only)
    except (
        *(zipfile.BadZipFile, InvalidFileException, ParseError, OSError, EOFError),
        *(KeyError, ValueError, TypeError, AttributeError, IndexError, zlib.error),
    ) as error:
        raise file_error(path, f"not readable as a workbook: {error}") from None


def _limited(path: Path, rows: Iterable[TableRow]) -> list[TableRow]:
    limited = list(islice(rows, MAX_ROWS + 1))
    if len(limited) > MAX_ROWS:
        raise file_error(path, f"more than {MAX_ROWS} rows; allowed at most {MAX_ROWS}")
    return limited


def _read_text(path: Path, data: bytes) -> list[TableRow]:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise file_error(path, f"the file is not UTF-8 text (byte {error.start})") from None
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
        return _limited(
            path,
            (
                TableRow(reader.line_num, tuple(_parse_cell(cell) for cell in cells[:MAX_COLUMNS]))
                for cells in reader
                if cells
            ),
        )
    except csv.Error as error:
        raise ConfigError(
            [Problem(display_path(path), reader.line_num, "", None, str(error))]
        ) from None


def _parse_cell(text: str) -> object:
    text = text.strip()
    if not text:
        return None
    number = _NUMBER.fullmatch(text) or _NOT_FINITE.fullmatch(text)
    return float(text) if number else text


def _read_sheet(path: Path, data: bytes, name: str | None) -> list[TableRow]:
    with open_workbook(path, data, read_only=True) as book:
        sheets = {sheet.title: sheet for sheet in book.worksheets}
        tables = {
            title: _limited(path, _sheet_rows(sheet))
            for title, sheet in sheets.items()
            if name is None or title == name
        }
    if name is not None and name not in tables:
        raise file_error(path, f"no sheet {name!r}; there are {', '.join(sheets)}")
    full = {title: rows for title, rows in tables.items() if rows}
    if len(full) > 1:
        raise file_error(path, f"several sheets, name one: {', '.join(full)}")
    return next(iter(full.values()), [])


def _sheet_rows(sheet: Any) -> Iterable[TableRow]:
    blank: list[TableRow] = []
    begun = False
    for number, row in enumerate(sheet.iter_rows(values_only=True), start=1):
        table_row = TableRow(number, tuple(_cell_value(cell) for cell in row[:MAX_COLUMNS]))
        if not any(cell is not None for cell in table_row.cells):
            if begun and len(blank) <= MAX_ROWS:
                blank.append(table_row)
            continue
        yield from blank  # blank rows are kept only between others
        blank, begun = [], True
        yield table_row


def _cell_value(cell: object) -> object:
    if isinstance(cell, int | float) and not isinstance(cell, bool):
        return float(cell)
    if isinstance(cell, str):
        return cell.strip() or None
    return cell


def _read_matrix(
    path: Path, data: bytes, name: str | None
) -> tuple[TableRow | None, list[TableRow]]:
    try:
        variables = matlab.load_variables(data)
    except ValueError as error:
        raise file_error(path, str(error)) from None
    full = {key: rows for key, rows in variables.matrices.items() if name in (None, key)}
    if len(full) != 1:
        names_text = ", ".join(variables.names) or "nothing"
        finding = f"{len(full)} numeric matrices" if name is None else f"no numeric matrix {name!r}"
        message = (
            f"{finding} among {names_text}; name one "
            "(a MATLAB table is not a matrix: save table2array)"
        )
        raise file_error(path, message)
    array = next(iter(full.values()))
    if len(array[0]) > MAX_COLUMNS:
        raise file_error(path, f"{len(array[0])} columns; allowed at most {MAX_COLUMNS}")
    names = variables.texts.get("columns")
    header = TableRow(1, tuple(names)) if names else None
    return header, _limited(path, (TableRow(i, tuple(row)) for i, row in enumerate(array, start=1)))
