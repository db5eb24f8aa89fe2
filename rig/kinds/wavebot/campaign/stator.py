"""Spring rates of the rows: the stator's positions, and those of a hoist's stations."""

from collections.abc import Sequence

from controllers import magnetic_spring
from rig.config.problems import ConfigError, Problem, format_number
from rig.config.yaml_source import KeyPath, SourceMap
from rig.kinds.wavebot.config.hoist import Hoist
from rig.kinds.wavebot.config.rig_file import MagneticSpring, RigFile
from rig.laws import Law
from rig.planning.point import Point
from rig.planning.points import locate_value


def stator_positions(rig: RigFile, points: Sequence[Point]) -> list[float]:
    """Return the stator position (%) that the loop will command for each point."""
    spring = rig.spring
    params = magnetic_spring.Params(*spring.by_rate(), spring.arrival_tolerance_percent)
    return [magnetic_spring.stator_position(params, point.spring_rate) for point in points]


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
        location = locate_value(key if key in locate.locations else key[:2], locate)
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
