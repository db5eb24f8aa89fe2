"""The points of the gain matrix, each with its location in the file."""

import itertools
import math

from controllers import magnetic_spring
from rig.config.columns import Column
from rig.config.matrix import Matrix
from rig.config.problems import ConfigError, Problem, format_key, format_number
from rig.config.yaml_source import KeyPath, SourceMap
from rig.kinds.wavebot.config.hoist import Hoist
from rig.kinds.wavebot.config.rig_file import MagneticSpring
from rig.laws import Law
from rig.planning.campaign import matrix_csv
from rig.planning.campaign.point import Point, ValueLocation, make_point


def count_points(matrix: Matrix) -> int:
    """Return the number of points of a grid or list; 0 for a CSV file, which must be read."""
    grid_sizes = (
        math.prod(len(value or (None,)) for _, value in grid) for grid in matrix.grid or ()
    )
    return sum(grid_sizes) + len(matrix.combinations or ())


def matrix_points(
    matrix: Matrix, locate: SourceMap, columns: tuple[Column, ...], law: Law
) -> tuple[Point, ...]:
    """Return all points in the order of the file; in a grid the last given column changes fastest.

    ``columns`` are those of a matrix for the ``law``.

    Raises `ConfigError` with file, line and column of every invalid cell of a CSV file.
    """
    if matrix.csv is not None:
        key = ("matrix", "csv")
        return matrix_csv.read_matrix_csv(locate.resolve_path(key, matrix.csv), locate(key), law)
    points = []
    for i, grid in enumerate(matrix.grid or ()):
        at = ("matrix", "grid", i)
        given = [c for c in columns if getattr(grid, c.key) is not None]
        axes = [_locate_values(getattr(grid, c.key), (*at, c.key), locate) for c in given]
        points += [make_point(given, pairs) for pairs in itertools.product(*axes)]
    for i, combination in enumerate(matrix.combinations or ()):
        at = ("matrix", "list", i)
        given = [c for c in columns if getattr(combination, c.key) is not None]
        pairs = [(getattr(combination, c.key), _locate_value((*at, c.key), locate)) for c in given]
        points.append(make_point(given, pairs))
    return tuple(points)


def unused_row_warnings(matrix: Matrix | None, locate: SourceMap, law: Law) -> tuple[Problem, ...]:
    """Return a warning about lines of a CSV matrix that are never run; empty if there are none."""
    if matrix is None or matrix.csv is None:
        return ()
    key = ("matrix", "csv")
    return matrix_csv.unused_row_warnings(locate.resolve_path(key, matrix.csv), locate(key), law)


def _locate_values(
    values: tuple[float, ...], key: KeyPath, locate: SourceMap
) -> list[tuple[float, ValueLocation]]:
    """Return each value with its location in a list; for a number or range, that of the key."""
    entries = ((*key, i) for i in range(len(values)))
    locations = [
        _locate_value(entry if entry in locate.locations else key, locate) for entry in entries
    ]
    return list(zip(values, locations, strict=True))


def _locate_value(key: KeyPath, locate: SourceMap) -> ValueLocation:
    return ValueLocation(locate(key), format_key(key))


def stator_positions(points: tuple[Point, ...], spring: MagneticSpring) -> dict[float, float]:
    """Return the stator position (%) that the loop will command for each spring rate (N/m)."""
    params = magnetic_spring.Params(*spring.by_rate(), spring.arrival_tolerance_percent)
    return {
        point.spring_rate: magnetic_spring.stator_position(params, point.spring_rate)
        for point in points
    }


def hoist_points(
    hoist: Hoist, spring: MagneticSpring, locate: SourceMap, law: Law
) -> tuple[Point, ...]:
    """Return the hoist's stations as points without gains, with the spring rates of the rig's map.

    Raises `ConfigError` for stations outside the map, to which the stator cannot be moved.
    """
    points, problems = [], []
    low, high = spring.map[0].stator_percent, spring.map[-1].stator_percent
    for i, station in enumerate(hoist.stations_percent):
        key: KeyPath = ("hoist", "stations_percent", i)
        location = _locate_value(key if key in locate.locations else key[:2], locate)
        rate = spring.rate(station)
        if rate is None:
            allowed = f"allowed {format_number(low)} .. {format_number(high)} %"
            message = f"stator position {format_number(station)} is outside the rig's spring map"
            problems.append(location.problem(station, f"{message}; {allowed}"))
            continue
        none = {column.name: 0.0 for column in law.columns if column.default is None}
        values = {"spring_rate": rate, **none}
        points.append(Point(values, dict.fromkeys(values, location)))
    if problems:
        raise ConfigError(problems)
    return tuple(points)


def spring_map_problems(points: tuple[Point, ...], spring: MagneticSpring) -> tuple[Problem, ...]:
    """Return a problem, with its location, for each spring rate outside the rig's spring map."""
    rates, _ = spring.by_rate()
    outside = dict.fromkeys(
        (point.spring_rate, point.locations["spring_rate"])
        for point in points
        if not rates[0] <= point.spring_rate <= rates[-1]
    )
    return tuple(
        location.problem(
            rate,
            f"spring rate {format_number(rate)} is outside the rig's spring map; "
            f"allowed {format_number(rates[0])} .. {format_number(rates[-1])} N/m",
        )
        for rate, location in outside
    )
