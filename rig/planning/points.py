"""The points of the gain matrix, each with its location in the file."""

import itertools
import math
from collections.abc import Iterable, Sequence

from rig.config.matrix import KindColumns, LawColumns, Matrix, MatrixColumns
from rig.config.problems import Problem, format_key
from rig.config.yaml_source import KeyPath, SourceMap
from rig.planning import matrix_csv
from rig.planning.point import Point, ValueLocation, make_point
from rig.row_contents import Column

Entries = Sequence[MatrixColumns] | None
"""Grids or single combinations of a file; None if it has none."""


def count_points(grids: Entries, combinations: Entries) -> int:
    """Return the number of points of grids and of a list."""
    grid_sizes = (math.prod(len(value or (None,)) for _, value in grid) for grid in grids or ())
    return sum(grid_sizes) + len(combinations or ())


def matrix_points(
    matrix: Matrix, locate: SourceMap, kind_columns: KindColumns, law_columns: LawColumns
) -> tuple[Point, ...]:
    """Return all points in the order of the file; in a grid the last given column changes fastest.

    Raises `ConfigError` with file, line and column of every invalid cell of a CSV file.
    """
    if matrix.csv is not None:
        key = ("matrix", "csv")
        path = locate.existing_path(key, matrix.csv)
        return matrix_csv.read_matrix_csv(path, locate(key), kind_columns, law_columns)
    columns = kind_columns.with_law(law_columns)
    grid_points = points_of_grids(matrix.grid, ("matrix", "grid"), columns, locate)
    return grid_points + points_of_list(matrix.combinations, ("matrix", "list"), columns, locate)


def points_of_grids(
    grids: Entries, at: KeyPath, columns: Iterable[Column], locate: SourceMap
) -> tuple[Point, ...]:
    """Return all combinations of the grids at a key; the last given column changes fastest."""
    points: list[Point] = []
    for i, grid in enumerate(grids or ()):
        given = [c for c in columns if getattr(grid, c.key) is not None]
        axes = [_locate_values(getattr(grid, c.key), (*at, i, c.key), locate) for c in given]
        points += [make_point(given, pairs) for pairs in itertools.product(*axes)]
    return tuple(points)


def points_of_list(
    combinations: Entries, at: KeyPath, columns: Iterable[Column], locate: SourceMap
) -> tuple[Point, ...]:
    """Return the combinations of the list at a key."""
    points = []
    for i, entry in enumerate(combinations or ()):
        given = [c for c in columns if getattr(entry, c.key) is not None]
        pairs = [(getattr(entry, c.key), locate_value((*at, i, c.key), locate)) for c in given]
        points.append(make_point(given, pairs))
    return tuple(points)


def unused_row_warnings(
    matrix: Matrix | None, locate: SourceMap, kind_columns: KindColumns, law_columns: LawColumns
) -> tuple[Problem, ...]:
    """Return a warning about lines of a CSV matrix that are never run; empty if there are none."""
    if matrix is None or matrix.csv is None:
        return ()
    key = ("matrix", "csv")
    path = locate.existing_path(key, matrix.csv)
    return matrix_csv.unused_row_warnings(path, locate(key), kind_columns, law_columns)


def _locate_values(
    values: tuple[float, ...], key: KeyPath, locate: SourceMap
) -> list[tuple[float, ValueLocation]]:
    """Return each value with its location in a list; for a number or range, that of the key."""
    entries = ((*key, i) for i in range(len(values)))
    locations = [
        locate_value(entry if entry in locate.locations else key, locate) for entry in entries
    ]
    return list(zip(values, locations, strict=True))


def locate_value(key: KeyPath, locate: SourceMap) -> ValueLocation:
    """Return the location of the value at a key."""
    return ValueLocation(locate(key), format_key(key))
