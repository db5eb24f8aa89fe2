"""The points of the gain matrix, each with the place in the file that asks for it."""

import itertools
import math

from controllers import magnetic_spring
from rig.config.columns import COLUMNS
from rig.config.hoist import Hoist
from rig.config.matrix import Matrix
from rig.config.problems import ConfigError, Problem, key_text, number_text
from rig.config.rig_file import MagneticSpring
from rig.config.yaml_source import KeyPath, Locate
from rig.planning.campaign import matrix_csv
from rig.planning.campaign.point import Point, Where, point


def count(matrix: Matrix) -> int:
    """Points of a grid or list, told from its lengths; 0 for a CSV, which has to be read."""
    grids = (
        math.prod(len(getattr(grid, column.key) or (None,)) for column in COLUMNS)
        for grid in matrix.grid or ()
    )
    return sum(grids) + len(matrix.combinations or ())


def points(matrix: Matrix, locate: Locate) -> tuple[Point, ...]:
    """All points in the order of the file; in a grid the last column given changes fastest.

    Raises `ConfigError` naming file, line and column of every bad cell of a CSV.
    """
    if matrix.csv is not None:
        key = ("matrix", "csv")
        return matrix_csv.read(locate.file(key, matrix.csv), locate(key))
    found = []
    for i, grid in enumerate(matrix.grid or ()):
        at = ("matrix", "grid", i)
        given = [c for c in COLUMNS if getattr(grid, c.key) is not None]
        axes = [_each(getattr(grid, c.key), (*at, c.key), locate) for c in given]
        found += [point(given, pairs) for pairs in itertools.product(*axes)]
    for i, one in enumerate(matrix.combinations or ()):
        at = ("matrix", "list", i)
        given = [c for c in COLUMNS if getattr(one, c.key) is not None]
        pairs = [(getattr(one, c.key), _where((*at, c.key), locate)) for c in given]
        found.append(point(given, pairs))
    return tuple(found)


def not_run(matrix: Matrix | None, locate: Locate) -> tuple[Problem, ...]:
    """A warning for lines of a matrix that no run reaches; empty if there are none."""
    if matrix is None or matrix.csv is None:
        return ()
    key = ("matrix", "csv")
    return matrix_csv.not_run(locate.file(key, matrix.csv), locate(key))


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


def hoisted(hoist: Hoist, spring: MagneticSpring, locate: Locate) -> tuple[Point, ...]:
    """The hoist's stations as points without gains, each with the rate that the map in use gives.

    Raises `ConfigError` for stations beyond the map: the stator could not be sent there.
    """
    found, bad = [], []
    low, high = spring.map[0].stator_percent, spring.map[-1].stator_percent
    for i, station in enumerate(hoist.stations_percent):
        key: KeyPath = ("hoist", "stations_percent", i)
        at = _where(key if key in locate.places else key[:2], locate)
        rate = spring.rate(station)
        if rate is None:
            allowed = f"allowed {number_text(low)} .. {number_text(high)} %"
            message = f"stator position {number_text(station)} is outside the rig's spring map"
            bad.append(at.problem(station, f"{message}; {allowed}"))
            continue
        given = {"spring_rate": rate, "kp": 0.0, "ki": 0.0}
        found.append(Point(given, dict.fromkeys(given, at)))
    if bad:
        raise ConfigError(bad)
    return tuple(found)


def outside_map(found: tuple[Point, ...], spring: MagneticSpring) -> tuple[Problem, ...]:
    """A problem for each spring rate the rig's spring cannot give, told where it stands."""
    rates, _ = spring.by_rate()
    bad = dict.fromkeys(
        (point.spring_rate, point.at["spring_rate"])
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
