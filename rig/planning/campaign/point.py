"""A point of the gain matrix, and where in the campaign's files its numbers stand."""

from collections.abc import Iterable
from typing import NamedTuple

from rig.config.columns import Column
from rig.config.problems import Problem, shown
from rig.config.yaml_source import Place

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
    """One combination of the matrix: what is given of each set point, and where it stands."""

    given: dict[str, float]  # by the set point's name (`rig.config.columns`)
    at: dict[str, Where]

    @property
    def spring_rate(self) -> float:
        """N/m."""
        return self.given["spring_rate"]

    @property
    def kp(self) -> float:
        """N*s/m."""
        return self.given["kp"]

    @property
    def ki(self) -> float:
        """N/m."""
        return self.given["ki"]


def point(columns: Iterable[Column], pairs: Iterable[tuple[float, Where]]) -> Point:
    """The point of these columns' values."""
    named = list(zip((column.name for column in columns), pairs, strict=True))
    return Point(
        {name: float(value) for name, (value, _) in named}, {name: at for name, (_, at) in named}
    )
