"""Points of the gain matrix: what was asked for, what was measured, and what varies."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import xarray

from rig.analysis.rows import COMPLETE, POWERS, standard_error
from rig.config.columns import COLUMNS, Column

Setting = dict[str, float]
"""A set point by the names of `rig.config.columns`; what a run does not know is left out."""


class Point(NamedTuple):
    """One combination of the gain matrix with the mean of its complete rows."""

    setting: Setting
    stator: float  # %
    power: dict[str, float]  # W by kind, negative is absorbed
    error: dict[str, float]  # W, standard error of `power`; NaN where unknown
    rows: tuple[int, ...]

    @property
    def spring_rate(self) -> float:
        """N/m."""
        return self.setting.get("spring_rate", float("nan"))

    @property
    def kp(self) -> float:
        """N*s/m."""
        return self.setting.get("kp", float("nan"))

    @property
    def ki(self) -> float:
        """N/m."""
        return self.setting.get("ki", float("nan"))


class Matrix(NamedTuple):
    """A gain matrix as it was run."""

    points: tuple[Point, ...]  # measured, in the order of the campaign
    asked: tuple[Setting, ...]  # every combination of the campaign, measured or not


def agrees(setting: Setting, fixed: Setting) -> bool:
    """Whether a set point has these values; a column it does not know cannot contradict."""
    return all(setting.get(name, value) == value for name, value in fixed.items())


def varied(matrix: Matrix) -> list[Column]:
    """Columns that take more than one value in the campaign."""
    found = []
    for column in COLUMNS:
        values = {each[column.name] for each in matrix.asked if column.name in each}
        if len(values) > 1:
            found.append(column)
    return found


def levels(matrix: Matrix, name: str) -> list[float]:
    """The values that a column takes in the campaign, increasing."""
    return sorted({each[name] for each in matrix.asked if name in each})


def row_settings(table: xarray.Dataset) -> list[Setting]:
    """The set point of each row of the table.

    A run without a plan tells a set point by a mean over its log: nine digits of it are kept, so
    that rounding makes no two points of one.
    """
    columns = {c.name: table[c.name].values.tolist() for c in COLUMNS if c.name in table}
    return [
        {
            name: float(f"{values[i]:.9g}") + 0.0  # there is no -0
            for name, values in columns.items()
            if np.isfinite(values[i])
        }
        for i in range(table.sizes.get("row", 0))
    ]


def matrix(table: xarray.Dataset) -> Matrix:
    """The gain matrix of a row table: equal set points are one point, however often it was asked.

    The error of a point that was run more than once comes from the scatter of its rows.
    """
    if "state" not in table or table.sizes["row"] == 0:
        return Matrix((), ())
    columns: dict[str, Any] = {str(name): table[name].values for name in table.variables}
    settings = row_settings(table)
    asked: dict[tuple[tuple[str, float], ...], Setting] = {}
    members: dict[tuple[tuple[str, float], ...], list[int]] = {}
    for i, setting in enumerate(settings):
        key = tuple(setting.items())
        asked.setdefault(key, setting)
        if columns["state"][i] == COMPLETE:
            members.setdefault(key, []).append(i)

    def error(kind: str, rows: list[int]) -> float:
        if len(rows) > 1:
            return standard_error(columns[f"power_{kind}"][rows])
        return float(columns[f"power_{kind}_se"][rows[0]])

    found = tuple(
        Point(
            settings[rows[0]],
            float(columns["stator"][rows[0]]),
            {kind: float(columns[f"power_{kind}"][rows].mean()) for kind in POWERS},
            {kind: error(kind, rows) for kind in POWERS},
            tuple(columns["row"][rows].tolist()),
        )
        for rows in members.values()
    )
    return Matrix(found, tuple(asked.values()))


def scatter_of(members: Iterable[Point]) -> str:
    """Whose scatter the standard errors of points tell, in words; empty where none is known."""
    names = {
        "repetitions" if len(point.rows) > 1 else "wave periods"
        for point in members
        if any(np.isfinite(error) for error in point.error.values())
    }
    return f"scatter of {' and '.join(sorted(names))}" if names else ""


def points(table: xarray.Dataset) -> list[Point]:
    """Points with at least one complete row, in the order of the campaign."""
    return list(matrix(table).points)
