"""A gain matrix kept in a CSV file: a header of column names, then one point a line."""

import math
from collections.abc import Sequence
from pathlib import Path

from rig.config.columns import ALWAYS, COLUMNS, END_MARK, Column
from rig.config.matrix import Combination
from rig.config.problems import ConfigError, Problem, lines_text, number_text, shown
from rig.config.ranges import allowed
from rig.config.yaml_source import Place
from rig.planning.campaign.point import MOST_ROWS, Point, Where, point
from rig.regular_file import CONFIG_MOST, read_regular

_NAMES = {column.key: column for column in COLUMNS}
_ALWAYS = ",".join(column.key for column in ALWAYS)
_HEADER = f"{_ALWAYS} and any of {','.join(c.key for c in COLUMNS[len(ALWAYS) :])}"


def read(path: Path, asked: Place) -> tuple[Point, ...]:
    """All points of the file, up to a row whose Kp is the end mark.

    ``asked`` is the place that names the file. Raises `ConfigError` naming line and column of
    every bad cell.
    """
    header: tuple[Column, ...] = ()
    problems, found = list[Problem](), list[Point]()
    for number, line in enumerate(_lines(path, asked), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if not header:
            header = _columns(path, number, line)
            continue
        row = _row(path, number, line, header)
        if row is None:
            break
        if isinstance(row, list):
            problems += row
        else:
            found.append(row)
        if len(found) + len(problems) > MOST_ROWS:
            message = f"more than {MOST_ROWS} rows; allowed at most {MOST_ROWS}"
            raise ConfigError([Problem(shown(path), number, "", line, message)])
    if problems:
        raise ConfigError(problems)
    if not found:
        message = f"no row; allowed a header {_ALWAYS} and at least one row"
        raise ConfigError([Problem(shown(path), 1, "", None, message)])
    return tuple(found)


def not_run(path: Path, asked: Place) -> tuple[Problem, ...]:
    """A warning for the lines that stand after the end mark; empty if there are none."""
    header: tuple[Column, ...] = ()
    ended, after = False, list[int]()
    for number, line in enumerate(_lines(path, asked), start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if not header:
            header = _columns(path, number, line)
        elif ended:
            after.append(number)
        else:
            ended = _ends(line, header)
    if not after:
        return ()
    message = (
        f"rows after the end mark (Kp = {number_text(END_MARK)}): {len(after)} "
        f"({lines_text(after)}), will not be run"
    )
    return (Problem(shown(path), after[0], "", None, message),)


def _ends(line: str, header: Sequence[Column]) -> bool:
    """Whether a line is the end mark."""
    cells = line.split(",")
    if len(cells) != len(header):
        return False
    try:
        return float(cells[[column.key for column in header].index("kp_n_s_per_m")]) == END_MARK
    except ValueError:
        return False


def _lines(path: Path, asked: Place) -> list[str]:
    try:
        return read_regular(path, CONFIG_MOST).decode("utf-8-sig").splitlines()
    except OSError as error:
        message = f"cannot read {shown(path)}: {error.strerror or type(error).__name__}"
        place = shown(asked.path)
        raise ConfigError([Problem(place, asked.line, "matrix.csv", str(path), message)]) from None
    except UnicodeDecodeError:
        raise ConfigError(
            [Problem(shown(path), 1, "", None, "the file is not UTF-8 text")]
        ) from None


def _columns(path: Path, number: int, line: str) -> tuple[Column, ...]:
    names = [cell.strip() for cell in line.split(",")]
    missing = [column.key for column in ALWAYS if column.key not in names]
    if missing or len(set(names)) < len(names) or not set(names) <= set(_NAMES):
        message = f"{line!r} is not the header; allowed {_HEADER}"
        raise ConfigError([Problem(shown(path), number, "", line, message)])
    return tuple(_NAMES[name] for name in names)


def _row(
    path: Path, number: int, line: str, header: Sequence[Column]
) -> Point | list[Problem] | None:
    """One row of the file; None for the end mark, a list for bad cells."""
    cells = line.split(",")
    names = [column.key for column in header]
    if len(cells) != len(names):
        message = f"{len(cells)} cells; allowed {len(names)}: {','.join(names)}"
        return [Problem(shown(path), number, "", line, message)]
    if _ends(line, header):
        return None
    values, problems, column = [], list[Problem](), 1
    for name, cell in zip(names, cells, strict=True):
        at = column + len(cell) - len(cell.lstrip())
        column += len(cell) + 1
        message = _wrong(name, cell.strip())
        if message:
            problems.append(Problem(shown(path), number, name, cell.strip(), message, at))
        else:
            values.append(float(cell))
    if problems:
        return problems
    place = Place(path, number)
    return point(header, zip(values, (Where(place, name) for name in names), strict=True))


def _wrong(name: str, cell: str) -> str:
    found = allowed(Combination, (name,))
    words = found.description(name) if found is not None else ""
    try:
        value = float(cell)
    except ValueError:
        return f"{cell!r} is not a number; allowed {words}"
    if not math.isfinite(value):
        return f"{cell} is not a finite number; allowed {words}"
    if found is not None and not found.holds(value):
        reason = f" ({found.reason()})" if found.reason() else ""
        return f"{number_text(value)} is out of range; allowed {words}{reason}"
    if found is not None and found.annotation is int and value != int(value):
        return f"{cell} is not a whole number; allowed {words}"
    return ""
