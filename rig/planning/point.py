"""A point of the gain matrix, with the file and line of each of its numbers."""

from collections.abc import Iterable
from typing import NamedTuple

from rig.config.problems import Problem, display_path
from rig.config.yaml_source import SourceLocation
from rig.row_contents import Column

MAX_ROWS = 10_000
"""Maximum number of rows of a campaign, with repetitions: two days of regular waves."""


class ValueLocation(NamedTuple):
    """Location and key of a number of the matrix."""

    location: SourceLocation
    key: str  # key path, or the column of a CSV

    def problem(self, value: object, message: str) -> Problem:
        """Return a problem of this number."""
        return Problem(
            display_path(self.location.path), self.location.line, self.key, value, message
        )


class Point(NamedTuple):
    """One combination of the matrix: the given values, and the location of each."""

    values: dict[str, float]  # by the set point's name (`Column.name`)
    locations: dict[str, ValueLocation]

    def __getattr__(self, name: str) -> float:
        """Return the value of a column by its name."""
        try:
            return self.values[name]
        except KeyError:
            raise AttributeError(f"the point has no {name}") from None


def make_point(columns: Iterable[Column], pairs: Iterable[tuple[float, ValueLocation]]) -> Point:
    """Return the point with a value and its location for each column."""
    named = list(zip((column.name for column in columns), pairs, strict=True))
    values = {name: float(value) for name, (value, _) in named}
    return Point(values, {name: location for name, (_, location) in named})
