"""Points of the gain matrix: repetitions averaged, and the best point of each spring rate."""

from typing import Any, NamedTuple

import numpy as np
import xarray

from rig.analysis.rows import COMPLETE, POWERS, standard_error


class Point(NamedTuple):
    """One combination of the gain matrix with the mean of its complete rows."""

    spring_rate: float  # N/m
    stator: float  # %
    kp: float  # N*s/m
    ki: float  # N/m
    power: dict[str, float]  # W by kind, negative is absorbed
    error: dict[str, float]  # W, standard error of `power`; NaN where unknown
    rows: tuple[int, ...]


class Optimum(NamedTuple):
    """The measured point of one spring rate that absorbs most."""

    kind: str
    point: Point
    at_edge: bool  # a gain at the end of its range: the true optimum may lie outside
    points: int  # measured at this spring rate

    @property
    def power(self) -> float:
        """W, negative is absorbed."""
        return self.point.power[self.kind]

    @property
    def error(self) -> float:
        """Standard error, W; NaN where unknown."""
        return self.point.error[self.kind]


def points(table: xarray.Dataset) -> list[Point]:
    """Points with at least one complete row, in the order of the campaign.

    The error of a point that was run more than once comes from the scatter of its rows.
    """
    if "state" not in table or table.sizes["row"] == 0:
        return []
    columns: dict[str, Any] = {str(name): table[name].values for name in table.variables}
    members: dict[int, list[int]] = {}
    for i in np.flatnonzero(columns["state"] == COMPLETE).tolist():
        members.setdefault(int(columns["point"][i]), []).append(i)

    def error(kind: str, rows: list[int]) -> float:
        if len(rows) > 1:
            return standard_error(columns[f"power_{kind}"][rows])
        return float(columns[f"power_{kind}_se"][rows[0]])

    return [
        Point(
            float(columns["spring_rate"][rows[0]]),
            float(columns["stator"][rows[0]]),
            float(columns["kp"][rows[0]]),
            float(columns["ki"][rows[0]]),
            {kind: float(columns[f"power_{kind}"][rows].mean()) for kind in POWERS},
            {kind: error(kind, rows) for kind in POWERS},
            tuple(columns["row"][rows].tolist()),
        )
        for rows in members.values()
    ]


def by_spring(found: list[Point]) -> dict[float, list[Point]]:
    """Points by spring rate, stiffest first."""
    rates = sorted({point.spring_rate for point in found}, reverse=True)
    return {rate: [point for point in found if point.spring_rate == rate] for rate in rates}


def optima(table: xarray.Dataset) -> list[Optimum]:
    """For each kind of power and each spring rate the measured point with the least power."""
    best = []
    groups = by_spring(points(table))
    for kind in POWERS:
        for group in groups.values():
            finite = [point for point in group if np.isfinite(point.power[kind])]
            if not finite:
                continue
            top = min(finite, key=lambda point: point.power[kind])
            edge = any(
                len(set(values)) > 1 and value in (min(values), max(values))
                for value, values in (
                    (top.kp, [point.kp for point in finite]),
                    (top.ki, [point.ki for point in finite]),
                )
            )
            best.append(Optimum(kind, top, edge, len(finite)))
    return best
