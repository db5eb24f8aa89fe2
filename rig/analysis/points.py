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
    at_edge: bool  # a gain at the end of its range in the campaign: the best may lie outside
    at_gap: bool  # the next point along Kp or Ki was not measured: the best may lie there
    points: int  # measured at this spring rate

    @property
    def doubt(self) -> str:
        """Where the true optimum may lie instead, in a word or two; empty if it lies here."""
        return "grid's edge" if self.at_edge else "beside a gap" if self.at_gap else ""

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
    """For each kind of power and each spring rate the measured point with the least power.

    Edges are those of all rows at that spring rate: one that is missing makes no new edge but a
    gap.
    """
    best = []
    groups = by_spring(points(table))
    asked = _gains(table) if groups else {}
    for kind in POWERS:
        for rate, group in groups.items():
            finite = [point for point in group if np.isfinite(point.power[kind])]
            if not finite:
                continue
            top = min(finite, key=lambda point: point.power[kind])
            here = (top.kp, top.ki)
            gap = not _neighbours(here, asked[rate]) <= {(point.kp, point.ki) for point in finite}
            best.append(Optimum(kind, top, _at_edge(here, asked[rate]), gap, len(finite)))
    return best


_Gains = tuple[float, float]  # Kp (N*s/m), Ki (N/m)


def _gains(table: xarray.Dataset) -> dict[float, set[_Gains]]:
    """The gains of all rows of each spring rate, measured or not."""
    found: dict[float, set[_Gains]] = {}
    columns = (table[name].values.tolist() for name in ("spring_rate", "kp", "ki"))
    for rate, *gains in zip(*columns, strict=True):
        found.setdefault(rate, set()).add((gains[0], gains[1]))
    return found


def _at_edge(here: _Gains, asked: set[_Gains]) -> bool:
    ranges = [(min(values), max(values)) for values in zip(*asked, strict=True)]
    return any(
        low < high and gain in (low, high) for gain, (low, high) in zip(here, ranges, strict=True)
    )


def _neighbours(here: _Gains, asked: set[_Gains]) -> set[_Gains]:
    """The next points in the four directions along Kp and Ki, as many as there are."""
    found = set()
    for along, across in ((0, 1), (1, 0)):
        line = [gains for gains in asked if gains[across] == here[across]]
        below = [gains for gains in line if gains[along] < here[along]]
        above = [gains for gains in line if gains[along] > here[along]]
        found |= {max(below)} if below else set()
        found |= {min(above)} if above else set()
    return found
