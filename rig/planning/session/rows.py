"""The rows of a session: every combination of its grids, or its list, with where each stands."""

import itertools
import math
from typing import NamedTuple

from rig.config.problems import format_key
from rig.config.session_file import SESSION_COLUMNS, SessionFile
from rig.config.yaml_source import KeyPath, SourceMap
from rig.planning.campaign.point import ValueLocation

MOST_ROWS = 1000
"""Most rows of a session, repetitions included."""


class SessionPoint(NamedTuple):
    """One row of the file: what is given of it, by the names of the columns, and where."""

    given: dict[str, float]
    at: dict[str, ValueLocation]


def count(file: SessionFile) -> int:
    """Rows of the file, without repetitions."""
    if file.rows is not None:
        return len(file.rows)
    sizes = ([len(values) for values in one.model_dump().values()] for one in file.grid or ())
    return sum(math.prod(lengths) for lengths in sizes)


def points(file: SessionFile, locate: SourceMap) -> tuple[SessionPoint, ...]:
    """The rows in the order of the file."""
    if file.rows is not None:
        return tuple(
            _point(row.model_dump(), {}, ("rows", i), locate) for i, row in enumerate(file.rows)
        )
    found = []
    for i, grid in enumerate(file.grid or ()):
        columns = grid.model_dump()
        for values in itertools.product(*(enumerate(column) for column in columns.values())):
            named = {key: value for key, (_, value) in zip(columns, values, strict=True)}
            index = {key: at for key, (at, _) in zip(columns, values, strict=True)}
            found.append(_point(named, index, ("grid", i), locate))
    return tuple(found)


def _point(
    given: dict[str, float], index: dict[str, int], at: KeyPath, locate: SourceMap
) -> SessionPoint:
    """A point of these values by file key; ``index``: which entry of its list each one is."""
    named, places = {}, {}
    for column in SESSION_COLUMNS:
        if column.key in given:
            key: KeyPath = (*at, column.key)
            entry = (*key, index[column.key]) if column.key in index else key
            key = entry if entry in locate.locations else key
            named[column.name] = float(given[column.key])
            places[column.name] = ValueLocation(locate(key), format_key(key))
    return SessionPoint(named, places)
