"""Points of two runs that stand for one another: equal set points, within a tolerance a column.

A column counts where it varies in at least one of the runs and both know it. One that varies in
neither is a setting of the whole run: where it differs, that is said and not matched. A drive
without settings (a commercial one) knows no drive column: then every set of drive parameters of
the one run is compared with the same point of the other.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rig.analysis.points import Matrix, Point, levels, varied
from rig.config.columns import COLUMNS, DRIVE_COLUMNS, Column

TOLERANCES: Mapping[str, float] = {  # SI; far below a step of any matrix, above rounding
    "spring_rate": 25.0,
    "kp": 25.0,
    "ki": 25.0,
    "km": 1.0,
    "reference_scale": 0.005,
    "realisation": 0.0,
    "surge_kp": 25.0,
    "surge_ki": 25.0,
    "bus_voltage": 0.5,
    "switching_period": 1e-6,
    "hysteresis_tolerance": 0.02,
    "velocity_threshold": 0.002,
    "discharge_level": 0.0,
}

_ROUNDING = 1e-9  # of the value, beside the tolerance
_TINY = 1e-300  # where tolerance and value are 0
_DRIVE = {column.name for column in DRIVE_COLUMNS}


class Pair(NamedTuple):
    """Two measured points of one set point."""

    a: Point
    b: Point


class Held(NamedTuple):
    """A column that varies in neither run and differs between them; None where not known."""

    column: Column
    a: float | None
    b: float | None


class Matched(NamedTuple):
    """What two matrices have in common."""

    pairs: tuple[Pair, ...]  # in the order of run A
    only_a: tuple[Point, ...]
    only_b: tuple[Point, ...]
    columns: tuple[Column, ...]  # matched on
    alone: tuple[Column, ...]  # vary in one run, unknown to the other
    held: tuple[Held, ...]


def knows(matrix: Matrix, column: Column) -> bool:
    """Whether a run has this setting: a commercial drive has a bus voltage of 0."""
    if column.name in _DRIVE:
        return any(each.get("bus_voltage", 0.0) > 0.0 for each in matrix.asked)
    return any(column.name in each for each in matrix.asked)


def match(a: Matrix, b: Matrix, tolerances: Mapping[str, float] | None = None) -> Matched:
    """The measured points of ``a`` and ``b`` that agree; ``tolerances`` (SI) replace the usual.

    Each point is used once, nearest pairs first, unless a column varies in one run alone.
    """
    allowed = {**TOLERANCES, **(tolerances or {})}
    anywhere = {c.name for c in varied(a)} | {c.name for c in varied(b)}
    moving = [c for c in COLUMNS if c.name in anywhere]
    columns = tuple(c for c in moving if knows(a, c) and knows(b, c))
    alone = tuple(c for c in moving if c not in columns)
    again_a = any(knows(b, c) for c in alone)  # varies in B alone: A's points serve several
    again_b = any(knows(a, c) for c in alone)
    near = sorted(_near(a.points, b.points, columns, allowed))
    taken: list[tuple[int, int]] = []
    used_a: set[int] = set()
    used_b: set[int] = set()
    for _, i, j in near:
        if (again_a or i not in used_a) and (again_b or j not in used_b):
            taken.append((i, j))
            used_a.add(i)
            used_b.add(j)
    return Matched(
        tuple(Pair(a.points[i], b.points[j]) for i, j in sorted(taken)),
        tuple(p for i, p in enumerate(a.points) if i not in used_a),
        tuple(p for j, p in enumerate(b.points) if j not in used_b),
        columns,
        alone,
        tuple(_held(a, b, [c for c in COLUMNS if c not in moving], allowed)),
    )


def apart(pair: Pair, columns: tuple[Column, ...]) -> dict[str, float]:
    """How far the set points of a pair are apart, by column, B less A; equal ones are left out."""
    steps = ((c.name, pair.b.setting[c.name] - pair.a.setting[c.name]) for c in columns)
    return {name: step for name, step in steps if step != 0.0}


def _near(
    a: Sequence[Point],
    b: Sequence[Point],
    columns: tuple[Column, ...],
    allowed: Mapping[str, float],
) -> Iterator[tuple[float, int, int]]:
    """Pairs no farther apart than allowed: squared distance in tolerances, number in A and B."""
    ones, others = (
        np.array([[p.setting.get(c.name, np.nan) for c in columns] for p in points])
        for points in (a, b)
    )
    if not a or not b:
        return
    tolerance = np.array([allowed[c.name] for c in columns])
    for i, one in enumerate(ones):
        step = np.abs(others - one)
        bound = tolerance + _ROUNDING * np.maximum(np.abs(others), np.abs(one))
        for j in np.flatnonzero((step <= bound).all(axis=1)).tolist():
            yield float(np.sum((step[j] / np.maximum(bound[j], _TINY)) ** 2)), i, j


def _held(a: Matrix, b: Matrix, still: list[Column], allowed: Mapping[str, float]) -> list[Held]:
    found = []
    for column in still:
        one, other = _constant(a, column), _constant(b, column)
        if one is None and other is None:
            continue
        if one is None or other is None or abs(one - other) > allowed[column.name]:
            found.append(Held(column, one, other))
    return found


def _constant(matrix: Matrix, column: Column) -> float | None:
    there = levels(matrix, column.name)
    return there[0] if there and knows(matrix, column) else None
