"""The points of the gain matrix, each with the place in the file that asks for it."""

import math
from pathlib import Path
from typing import NamedTuple

from controllers import magnetic_spring
from rig.config.matrix import END_MARK, Combination, Matrix
from rig.config.problems import ConfigError, Problem, key_text, number_text, shown
from rig.config.ranges import allowed
from rig.config.rig_file import MagneticSpring
from rig.config.source import KeyPath, Locate, Place

COLUMNS = ("spring_n_per_m", "kp_n_s_per_m", "ki_n_per_m")

MOST_ROWS = 10_000
"""Most rows of a campaign, repetitions included; two days of regular waves."""


class Where(NamedTuple):
    """Where a number of the matrix stands."""

    place: Place
    key: str  # key path, or the column of a CSV

    def problem(self, value: object, message: str) -> Problem:
        """A problem of this number."""
        return Problem(shown(self.place.path), self.place.line, self.key, value, message)


class Point(NamedTuple):
    """One combination of the matrix, and where the numbers stand that a rig may refuse."""

    spring_rate: float  # N/m
    kp: float  # N*s/m
    ki: float  # N/m
    spring_at: Where
    ki_at: Where


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
        at = ("matrix", "grid", i)
        rates = _each(grid.spring_n_per_m, (*at, "spring_n_per_m"), locate)
        kis = _each(grid.ki_n_per_m, (*at, "ki_n_per_m"), locate)
        found += [
            Point(rate, kp, ki, spring_at, ki_at)
            for rate, spring_at in rates
            for kp in grid.kp_n_s_per_m
            for ki, ki_at in kis
        ]
    for i, one in enumerate(matrix.combinations or ()):
        at = ("matrix", "list", i)
        spring_at = _where((*at, "spring_n_per_m"), locate)
        ki_at = _where((*at, "ki_n_per_m"), locate)
        found.append(Point(one.spring_n_per_m, one.kp_n_s_per_m, one.ki_n_per_m, spring_at, ki_at))
    return tuple(found)


def _each(values: tuple[float, ...], key: KeyPath, locate: Locate) -> list[tuple[float, Where]]:
    """Each value with its place in a list, or with the key where a number or a range gives it."""
    entries = ((*key, i) for i in range(len(values)))
    at = [_where(entry if entry in locate.places else key, locate) for entry in entries]
    return list(zip(values, at, strict=True))


def _where(key: KeyPath, locate: Locate) -> Where:
    return Where(locate(key), key_text(key))


def stator_positions(found: tuple[Point, ...], spring: MagneticSpring) -> dict[float, float]:
    """Stator position (%) of each spring rate (N/m): what the loop will command."""
    params = magnetic_spring.Params(*spring.by_rate(), spring.arrival_tolerance_percent)
    return {
        point.spring_rate: magnetic_spring.stator_position(params, point.spring_rate)
        for point in found
    }


def outside_map(found: tuple[Point, ...], spring: MagneticSpring) -> tuple[Problem, ...]:
    """A problem for each spring rate the rig's spring cannot give, told where it stands."""
    rates, _ = spring.by_rate()
    bad = dict.fromkeys(
        (point.spring_rate, point.spring_at)
        for point in found
        if not rates[0] <= point.spring_rate <= rates[-1]
    )
    return tuple(
        at.problem(
            rate,
            f"spring rate {number_text(rate)} is outside the rig's spring map; "
            f"allowed {number_text(rates[0])} .. {number_text(rates[-1])} N/m",
        )
        for rate, at in bad
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
    place = Place(path, number)
    spring_at, _, ki_at = (Where(place, name) for name in COLUMNS)
    return Point(values[0], values[1], values[2], spring_at, ki_at)


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
