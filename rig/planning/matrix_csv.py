"""Reading of a gain matrix from a CSV file: a header of column names, then one point per line."""

import math
from collections.abc import Sequence
from pathlib import Path

from rig.config.matrix import END_MARK, KindColumns, LawColumns, MatrixColumns, combination_model
from rig.config.problems import (
    ConfigError,
    Problem,
    display_path,
    format_line_numbers,
    format_number,
)
from rig.config.ranges import allowed_values
from rig.config.yaml_source import SourceLocation
from rig.planning.point import MAX_ROWS, Point, ValueLocation, make_point
from rig.regular_file import MAX_CONFIG_BYTES, read_regular
from rig.row_contents import Column

_KP = "kp_n_s_per_m"  # the column with the end mark


def read_matrix_csv(
    path: Path, named_at: SourceLocation, columns: KindColumns, law_columns: LawColumns
) -> tuple[Point, ...]:
    """Return all points of the file, up to a row whose Kp is the end mark.

    ``named_at`` is the location that names the file; ``columns`` and ``law_columns`` define its
    columns. Raises `ConfigError` with line and column of every invalid cell.
    """
    header: tuple[Column, ...] = ()
    problems, points = list[Problem](), list[Point]()
    for number, line in enumerate(_lines(path, named_at), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if not header:
            header = _parse_header(path, number, line, columns, law_columns)
            continue
        row = _parse_row(path, number, line, header, combination_model(columns, law_columns))
        if row is None:
            break
        if isinstance(row, list):
            problems += row
        else:
            points.append(row)
        if len(points) + len(problems) > MAX_ROWS:
            message = f"more than {MAX_ROWS} rows; allowed at most {MAX_ROWS}"
            raise ConfigError([Problem(display_path(path), number, "", line, message)])
    if problems:
        raise ConfigError(problems)
    if not points:
        required = ",".join(column.key for column in columns.required(law_columns))
        message = f"no row; allowed a header {required} and at least one row"
        raise ConfigError([Problem(display_path(path), 1, "", None, message)])
    return tuple(points)


def unused_row_warnings(
    path: Path, named_at: SourceLocation, columns: KindColumns, law_columns: LawColumns
) -> tuple[Problem, ...]:
    """Return a warning about the lines after the end mark; empty if there are none."""
    header: tuple[Column, ...] = ()
    ended, unused = False, list[int]()
    for number, line in enumerate(_lines(path, named_at), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if not header:
            header = _parse_header(path, number, line, columns, law_columns)
        elif ended:
            unused.append(number)
        else:
            ended = _is_end_mark(line, header)
    if not unused:
        return ()
    message = (
        f"rows after the end mark (Kp = {format_number(END_MARK)}): {len(unused)} "
        f"({format_line_numbers(unused)}), will not be run"
    )
    return (Problem(display_path(path), unused[0], "", None, message),)


def _is_end_mark(line: str, header: Sequence[Column]) -> bool:
    """Return whether a line is the end mark."""
    cells = line.split(",")
    keys = [column.key for column in header]
    if len(cells) != len(header) or _KP not in keys:
        return False
    try:
        return float(cells[keys.index(_KP)]) == END_MARK
    except ValueError:
        return False


def _lines(path: Path, named_at: SourceLocation) -> list[str]:
    try:
        return read_regular(path, MAX_CONFIG_BYTES).decode("utf-8-sig").splitlines()
    except OSError as error:
        message = f"cannot read {display_path(path)}: {error.strerror or type(error).__name__}"
        file = display_path(named_at.path)
        raise ConfigError(
            [Problem(file, named_at.line, "matrix.csv", str(path), message)]
        ) from None
    except UnicodeDecodeError:
        raise ConfigError(
            [Problem(display_path(path), 1, "", None, "the file is not UTF-8 text")]
        ) from None


def _parse_header(
    path: Path, number: int, line: str, columns: KindColumns, law_columns: LawColumns
) -> tuple[Column, ...]:
    names = [cell.strip() for cell in line.split(",")]
    by_key = {column.key: column for column in columns.with_law(law_columns)}
    required = [column.key for column in columns.required(law_columns)]
    missing = [key for key in required if key not in names]
    if missing or len(set(names)) < len(names) or not set(names) <= set(by_key):
        others = ",".join(key for key in by_key if key not in required)
        message = f"{line!r} is not the header; allowed {','.join(required)} and any of {others}"
        raise ConfigError([Problem(display_path(path), number, "", line, message)])
    return tuple(by_key[name] for name in names)


def _parse_row(
    path: Path, number: int, line: str, header: Sequence[Column], model: type[MatrixColumns]
) -> Point | list[Problem] | None:
    """Return one row of the file; None for the end mark, a list of problems for invalid cells."""
    cells = line.split(",")
    names = [column.key for column in header]
    if len(cells) != len(names):
        message = f"{len(cells)} cells; allowed {len(names)}: {','.join(names)}"
        return [Problem(display_path(path), number, "", line, message)]
    if _is_end_mark(line, header):
        return None
    values, problems, column = [], list[Problem](), 1
    for (name, choices), cell in zip(((c.key, c.choices) for c in header), cells, strict=True):
        cell_column = column + len(cell) - len(cell.lstrip())
        column += len(cell) + 1
        if cell.strip() in choices:
            values.append(float(choices.index(cell.strip())))
            continue
        message = _cell_error(name, cell.strip(), model, choices)
        if message:
            problems.append(
                Problem(display_path(path), number, name, cell.strip(), message, cell_column)
            )
        else:
            values.append(float(cell))
    if problems:
        return problems
    location = SourceLocation(path, number)
    return make_point(
        header, zip(values, (ValueLocation(location, name) for name in names), strict=True)
    )


def _cell_error(
    name: str, cell: str, model: type[MatrixColumns], choices: Sequence[str] = ()
) -> str:
    """Return the error message for a cell of a column; empty if the cell is valid."""
    allowed = allowed_values(model, (name,))
    range_text = allowed.description(name) if allowed is not None else ""
    range_text += "".join(f", {each}" for each in choices)
    try:
        value = float(cell)
    except ValueError:
        return f"{cell!r} is not a number; allowed {range_text}"
    if not math.isfinite(value):
        return f"{cell} is not a finite number; allowed {range_text}"
    if allowed is not None and not allowed.contains(value):
        reason = f" ({allowed.reason()})" if allowed.reason() else ""
        return f"{format_number(value)} is out of range; allowed {range_text}{reason}"
    whole = bool(choices) or (allowed is not None and allowed.annotation is int)
    if whole and value != int(value):
        return f"{cell} is not a whole number; allowed {range_text}"
    return ""
