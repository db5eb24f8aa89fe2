"""Matching of the points of two runs by set point, within a tolerance for each column.

Points are matched on the columns that vary in at least one run and exist in both. A column that
varies in neither run is a setting of the whole run; a difference is reported, not matched. A drive
without settings (a commercial one) has no drive columns: every set of drive parameters of one run
is then compared with the same point of the other.
"""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from rig.analysis.points import Matrix, Point, levels, varied_columns
from rig.analysis.run_columns import union
from rig.config.columns import DRIVE_COLUMNS, Column

TOLERANCES: Mapping[str, float] = {  # SI; far below the steps of any matrix, above rounding
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

_ROUNDING = 1e-9  # relative to the value, added to the tolerance
_TINY = 1e-300  # avoids 0/0 where tolerance and value are 0
_DRIVE = {column.name for column in DRIVE_COLUMNS}


class Pair(NamedTuple):
    """Measured points of both runs at one set point."""

    a: Point
    b: Point


class ConstantDifference(NamedTuple):
    """A column that varies in neither run and differs between them; None where a run lacks it."""

    column: Column
    a: float | None
    b: float | None


class MatchedPoints(NamedTuple):
    """The matched points of two matrices, and the points and columns without a counterpart."""

    pairs: tuple[Pair, ...]  # in the order of run A
    only_a: tuple[Point, ...]
    only_b: tuple[Point, ...]
    columns: tuple[Column, ...]  # matched on
    one_sided: tuple[Column, ...]  # vary in one run, absent from the other
    constant_differences: tuple[ConstantDifference, ...]


def has_column(matrix: Matrix, column: Column) -> bool:
    """Return whether a run has this setting; drive settings exist if its bus voltage exceeds 0."""
    if column.name in _DRIVE:
        return any(setting.get("bus_voltage", 0.0) > 0.0 for setting in matrix.planned)
    return any(column.name in setting for setting in matrix.planned)


def match(a: Matrix, b: Matrix, tolerances: Mapping[str, float] | None = None) -> MatchedPoints:
    """Match the measured points of ``a`` and ``b``; ``tolerances`` (SI) override `TOLERANCES`.

    Each point is used once, nearest pairs first, unless a column varies in one run alone.
    """
    limits = defaultdict(float, {**TOLERANCES, **(tolerances or {})})  # 0 for other columns
    varied_names = {c.name for c in varied_columns(a)} | {c.name for c in varied_columns(b)}
    all_columns = union((a.columns, b.columns))
    varied = [c for c in all_columns if c.name in varied_names]
    columns = tuple(c for c in varied if has_column(a, c) and has_column(b, c))
    one_sided = tuple(c for c in varied if c not in columns)
    # A column that varies in B alone: several points of B share one point of A.
    reuse_a = any(has_column(b, c) for c in one_sided)
    reuse_b = any(has_column(a, c) for c in one_sided)
    candidates = sorted(_candidate_pairs(a.points, b.points, columns, limits))
    pairs: list[tuple[int, int]] = []
    used_a: set[int] = set()
    used_b: set[int] = set()
    for _, i, j in candidates:
        if (reuse_a or i not in used_a) and (reuse_b or j not in used_b):
            pairs.append((i, j))
            used_a.add(i)
            used_b.add(j)
    return MatchedPoints(
        tuple(Pair(a.points[i], b.points[j]) for i, j in sorted(pairs)),
        tuple(p for i, p in enumerate(a.points) if i not in used_a),
        tuple(p for j, p in enumerate(b.points) if j not in used_b),
        columns,
        one_sided,
        tuple(
            _find_constant_differences(a, b, [c for c in all_columns if c not in varied], limits)
        ),
    )


def set_point_offsets(pair: Pair, columns: tuple[Column, ...]) -> dict[str, float]:
    """Return the difference of set points, B less A, by column; equal columns are left out."""
    steps = ((c.name, pair.b.setting[c.name] - pair.a.setting[c.name]) for c in columns)
    return {name: step for name, step in steps if step != 0.0}


def _candidate_pairs(
    a: Sequence[Point],
    b: Sequence[Point],
    columns: tuple[Column, ...],
    limits: Mapping[str, float],
) -> Iterator[tuple[float, int, int]]:
    """Yield pairs within tolerance: squared distance in tolerances, index in A, index in B."""
    values_a, values_b = (
        np.array([[p.setting.get(c.name, np.nan) for c in columns] for p in points])
        for points in (a, b)
    )
    if not a or not b:
        return
    tolerance = np.array([limits[c.name] for c in columns])
    for i, value_a in enumerate(values_a):
        steps = np.abs(values_b - value_a)
        bounds = tolerance + _ROUNDING * np.maximum(np.abs(values_b), np.abs(value_a))
        for j in np.flatnonzero((steps <= bounds).all(axis=1)).tolist():
            yield float(np.sum((steps[j] / np.maximum(bounds[j], _TINY)) ** 2)), i, j


def _find_constant_differences(
    a: Matrix, b: Matrix, constant_columns: list[Column], limits: Mapping[str, float]
) -> list[ConstantDifference]:
    differences = []
    for column in constant_columns:
        value_a, value_b = _constant_value(a, column), _constant_value(b, column)
        if value_a is None and value_b is None:
            continue
        if value_a is None or value_b is None or abs(value_a - value_b) > limits[column.name]:
            differences.append(ConstantDifference(column, value_a, value_b))
    return differences


def _constant_value(matrix: Matrix, column: Column) -> float | None:
    values = levels(matrix, column.name)
    return values[0] if values and has_column(matrix, column) else None
