"""The rows of a session: every combination of its grids, or its list, with the location of each
value.
"""

import itertools
import math
from typing import NamedTuple

from rig.config.problems import format_key
from rig.config.yaml_source import KeyPath, SourceMap
from rig.kinds.oswec_bench.config.session_file import SESSION_COLUMNS, SessionFile
from rig.planning.point import ValueLocation

MAX_ROWS = 1000
"""Maximum number of rows of a session, repetitions included."""


class SessionPoint(NamedTuple):
    """One row of the file: values by column name, and their locations."""

    values: dict[str, float]
    locations: dict[str, ValueLocation]


def count_rows(file: SessionFile) -> int:
    """Return the number of rows of the file, without repetitions."""
    if file.rows is not None:
        return len(file.rows)
    sizes = ([len(values) for values in grid.model_dump().values()] for grid in file.grid or ())
    return sum(math.prod(lengths) for lengths in sizes)


def session_points(file: SessionFile, locate: SourceMap) -> tuple[SessionPoint, ...]:
    """Return the rows in the order of the file."""
    if file.rows is not None:
        return tuple(
            _point(row.model_dump(), {}, ("rows", i), locate) for i, row in enumerate(file.rows)
        )
    expanded = []
    for i, grid in enumerate(file.grid or ()):
        columns = grid.model_dump()
        for values in itertools.product(*(enumerate(column) for column in columns.values())):
            values_by_key = {key: value for key, (_, value) in zip(columns, values, strict=True)}
            index = {key: at for key, (at, _) in zip(columns, values, strict=True)}
            expanded.append(_point(values_by_key, index, ("grid", i), locate))
    return tuple(expanded)


def _point(
    values_by_key: dict[str, float], index: dict[str, int], at: KeyPath, locate: SourceMap
) -> SessionPoint:
    """Return a point of these values by file key; ``index`` gives the list entry of each value."""
    values, locations = {}, {}
    for column in SESSION_COLUMNS:
        if column.key in values_by_key:
            key: KeyPath = (*at, column.key)
            entry = (*key, index[column.key]) if column.key in index else key
            key = entry if entry in locate.locations else key
            values[column.name] = float(values_by_key[column.key])
            locations[column.name] = ValueLocation(locate(key), format_key(key))
    return SessionPoint(values, locations)
