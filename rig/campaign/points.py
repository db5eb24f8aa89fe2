"""The points of the gain matrix, each with the place in the file that asks for it."""

import math
from pathlib import Path
from typing import NamedTuple

from controllers import magnetic_spring
from rig.config.matrix import END_MARK, Combination, Matrix
from rig.config.problems import ConfigError, Problem, key_text, number_text, shown
from rig.config.ranges import allowed
from rig.config.rig_file import MagneticSpring
from rig.config.source import Locate, Place

COLUMNS = ("spring_n_per_m", "kp_n_s_per_m", "ki_n_per_m")

MOST_ROWS = 10_000
"""Most rows of a campaign, repetitions included; two days of regular waves."""


class Point(NamedTuple):
    """One combination of the matrix, and where it stands."""

    spring_rate: float  # N/m
    kp: float  # N*s/m
    ki: float  # N/m
    place: Place
    key: str  # key path, or the column of a CSV, of the entry

    def problem(self, value: object, message: str) -> Problem:
        """A problem of this point."""
        return Problem(shown(self.place.path), self.place.line, self.key, value, message)


def count(matrix: Matrix) -> int:
    """Points of a grid or list, told from its lengths; 0 for a CSV, which has to be read."""
    grids = (
        len(grid.spring_n_per_m) * len(grid.kp_n_s_per_m) * len(grid.ki_n_per_m)
        for grid in matrix.grid or ()
    )
    return sum(grids) + len(matrix.combinations or ())


def points(matrix: Matrix, locate: Locate) -> tuple[Point, ...]:
    """All points in the order of the file; Kp outer and Ki inner in a grid.

    Raises `ConfigError` naming file, line and column of every bad cell of a CSV.
    """
    if matrix.csv is not None:
        key = ("matrix", "csv")
        return _from_csv(locate.file(key, matrix.csv), locate(key))
    found = []
    for i, grid in enumerate(matrix.grid or ()):
        key_ki = ("matrix", "grid", i, "ki_n_per_m")
        place = locate(key_ki)
        found += [
            Point(rate, kp, ki, place, key_text(key_ki))
            for rate in grid.spring_n_per_m
            for kp in grid.kp_n_s_per_m
            for ki in grid.ki_n_per_m
        ]
    for i, one in enumerate(matrix.combinations or ()):
        key_entry = ("matrix", "list", i)
        found.append(
            Point(
                one.spring_n_per_m,
                one.kp_n_s_per_m,
                one.ki_n_per_m,
                locate(key_entry),
                key_text(key_entry),
            )
        )
    return tuple(found)


def stator_positions(found: tuple[Point, ...], spring: MagneticSpring) -> dict[float, float]:
    """Stator position (%) of each spring rate (N/m): what the loop will command."""
    params = magnetic_spring.Params(*spring.by_rate(), spring.arrival_tolerance_percent)
    return {
        point.spring_rate: magnetic_spring.stator_position(params, point.spring_rate)
        for point in found
    }


def outside_map(found: tuple[Point, ...], spring: MagneticSpring) -> tuple[Problem, ...]:
    """A problem for each spring rate the rig's spring cannot give, at the first such point."""
    rates, _ = spring.by_rate()
    first: dict[tuple[float, Place], Point] = {}
    for point in found:
        if not rates[0] <= point.spring_rate <= rates[-1]:
            first.setdefault((point.spring_rate, point.place), point)
    return tuple(
        point.problem(
            point.spring_rate,
            f"spring rate {number_text(point.spring_rate)} is outside the rig's spring map; "
            f"allowed {number_text(rates[0])} .. {number_text(rates[-1])} N/m",
        )
        for point in first.values()
    )


def _from_csv(path: Path, asked: Place) -> tuple[Point, ...]:
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except OSError as error:
        message = f"cannot read {shown(path)}: {error.strerror or type(error).__name__}"
        raise ConfigError(
            [Problem(shown(asked.path), asked.line, "matrix.csv", str(path), message)]
        ) from None
    except UnicodeDecodeError:
        raise ConfigError(
            [Problem(shown(path), 1, "", None, "the file is not UTF-8 text")]
        ) from None
    header, problems, found = "", list[Problem](), list[Point]()
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if not header:
            header = line
            if tuple(cell.strip() for cell in line.split(",")) != COLUMNS:
                message = f"{line!r} is not the header; allowed {','.join(COLUMNS)}"
                raise ConfigError([Problem(shown(path), number, "", line, message)])
            continue
        row = _row(path, number, line)
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
        message = f"no row; allowed a header {','.join(COLUMNS)} and at least one row"
        raise ConfigError([Problem(shown(path), 1, "", None, message)])
    return tuple(found)


def _row(path: Path, number: int, line: str) -> Point | list[Problem] | None:
    """One row of the file; None for the end mark, a list for bad cells."""
    cells = line.split(",")
    if len(cells) != len(COLUMNS):
        message = f"{len(cells)} cells; allowed {len(COLUMNS)}: {','.join(COLUMNS)}"
        return [Problem(shown(path), number, "", line, message)]
    try:
        if float(cells[1]) == END_MARK:
            return None
    except ValueError:
        pass  # told below, with its column
    values, problems, column = [], list[Problem](), 1
    for name, cell in zip(COLUMNS, cells, strict=True):
        at = column + len(cell) - len(cell.lstrip())
        column += len(cell) + 1
        message = _wrong(name, cell.strip())
        if message:
            problems.append(Problem(shown(path), number, name, cell.strip(), message, at))
        else:
            values.append(float(cell))
    if problems:
        return problems
    return Point(values[0], values[1], values[2], Place(path, number), "ki_n_per_m")


def _wrong(name: str, cell: str) -> str:
    found = allowed(Combination, (name,))
    words = found.words(name) if found is not None else ""
    try:
        value = float(cell)
    except ValueError:
        return f"{cell!r} is not a number; allowed {words}"
    if not math.isfinite(value):
        return f"{cell} is not a finite number; allowed {words}"
    if found is not None and not found.holds(value):
        reason = f" ({found.reason()})" if found.reason() else ""
        return f"{number_text(value)} is out of range; allowed {words}{reason}"
    return ""
