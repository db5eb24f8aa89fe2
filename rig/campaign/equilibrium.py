"""Set points that leave the body no equilibrium: what a kind of rig finds, as problems of a matrix.

A kind knows the stiffness of its body, so it gives the check of a single set point.
"""

from collections.abc import Callable, Iterable, Iterator
from typing import Any, NamedTuple

from rig.config.problems import Problem
from rig.config.yaml_source import SourceMap
from rig.planning.point import Point, ValueLocation


class NoEquilibrium(NamedTuple):
    """A set point that leaves the body no equilibrium, or too little stiffness."""

    column: str  # name of the column that is to blame; empty: none alone
    value: float | None  # of that column
    message: str  # with the value and the largest allowed one
    can_run: bool = False  # a limit or an end stop holds the body before the rig would stop


EquilibriumCheck = Callable[[Any], NoEquilibrium | None]
"""Check of a set point: an object with the columns of the matrix by name, such as a `Point`."""


def equilibrium_problems(
    points: Iterable[Point], check: EquilibriumCheck, locate: SourceMap
) -> Iterator[tuple[Problem, bool]]:
    """Yield a problem for each finding, and whether the row can run; ``locate``: of the campaign.

    Points with the same number of the file and the same message, such as those that differ only in
    Kp, give one problem.
    """
    groups: dict[tuple[NoEquilibrium, ValueLocation | None], list[int]] = {}
    for number, point in enumerate(points):
        if (found := check(point)) is not None:
            at = point.locations.get(found.column)
            groups.setdefault((found, at), []).append(number)
    for (found, at), (first, *others) in groups.items():
        more = f" (and {len(others)} more like it)" if others else ""
        message = f"point {first}{more} {found.message}"
        if at is None:
            yield locate.problem(("matrix",), found.value, message), found.can_run
        else:
            yield at.problem(found.value, message), found.can_run
