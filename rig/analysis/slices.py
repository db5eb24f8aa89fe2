"""Slices of a gain matrix: power over two columns, all others held, and the best point in it.

A matrix of more than two columns is sliced where the station in question absorbs most: every
column that is left out stands at its value there (MASK4 report (Sandia), section 4.3). So each
station has a slice of its own.
"""

from math import isclose
from typing import NamedTuple

import numpy as np
import xarray
from scipy.stats import chi2

from rig.analysis.labels import BY_NAME, quantity
from rig.analysis.mesh import Place, spans_surface
from rig.analysis.points import Matrix, Point, Setting, agrees, levels, matrix, varied
from rig.analysis.rows import POWERS
from rig.config.columns import Column

KP, KI, SPRING_RATE = BY_NAME["kp"], BY_NAME["ki"], BY_NAME["spring_rate"]
_SAME = 1e-6  # relative: values that differ by less are the same
_EVEN = 0.01  # of a step: steps that differ by less are even
LEAST_RELIEF = 0.01  # of the power: what differs by less is no relief
_LEVELS = 3  # of a column, for one of them to lie inside

WITHIN_ERRORS = "within errors"
WITHIN_RELIEF = f"within {100.0 * LEAST_RELIEF:g} %"
_NO_SPREAD = "no more spread than its errors explain"


class Optimum(NamedTuple):
    """The measured point that absorbs most."""

    kind: str
    point: Point
    at_edge: bool  # at the end of a range of three values and more: the best may lie outside
    at_gap: bool  # the next point along an axis was not measured: the best may lie there
    points: int  # measured, of which it is the best
    flat: str  # how little the points of its slice differ; empty if they do
    idle: tuple[str, ...]  # left-out columns along which power does not differ from here

    @property
    def doubt(self) -> str:
        """Where the true optimum may lie instead, in a word or two; empty if it lies here.

        Where nothing differs that is said, and neither edge nor gap means anything.
        """
        edge = "grid's edge" if self.at_edge else "beside a gap" if self.at_gap else ""
        return self.flat or edge

    @property
    def power(self) -> float:
        """W, negative is absorbed."""
        return self.point.power[self.kind]

    @property
    def error(self) -> float:
        """Standard error, W; NaN where unknown."""
        return self.point.error[self.kind]


class Slice(NamedTuple):
    """The points of a matrix over two columns for one kind of power."""

    kind: str
    x: Column
    y: Column
    held: Setting  # columns whose value was asked for
    sliced: Setting  # columns left out, at the optimum
    points: tuple[Point, ...]  # measured in the slice, with a value
    missing: tuple[Place, ...]  # asked for in the slice and not measured
    best: Optimum | None  # None where nothing was measured

    @property
    def places(self) -> list[Place]:
        """x and y of each point."""
        return [(p.setting[self.x.name], p.setting[self.y.name]) for p in self.points]

    @property
    def values(self) -> list[float]:
        """Power of each point, W."""
        return [p.power[self.kind] for p in self.points]


def cut(matrix: Matrix, kind: str, x: Column, y: Column, held: Setting | None = None) -> Slice:
    """The slice through the best point of those with the values ``held`` (all without).

    Raises ValueError, saying which there are, for a value that is not in the campaign.
    """
    held = {n: _known(matrix, n, v) for n, v in (held or {}).items() if np.isfinite(v)}
    found = [
        p
        for p in matrix.points
        if agrees(p.setting, held)
        and np.isfinite(p.power[kind])
        and x.name in p.setting
        and y.name in p.setting
    ]
    if not found:
        return Slice(kind, x, y, held, {}, (), (), None)
    top = min(found, key=lambda point: point.power[kind])
    left_out = {c.name for c in varied(matrix)} - {x.name, y.name, *held}
    sliced = {n: v for n, v in top.setting.items() if n in left_out}
    inside = tuple(p for p in found if agrees(p.setting, sliced))
    asked = {
        (s[x.name], s[y.name])
        for s in matrix.asked
        if agrees(s, held | sliced) and x.name in s and y.name in s
    }
    measured = {(p.setting[x.name], p.setting[y.name]) for p in inside}
    here = (top.setting[x.name], top.setting[y.name])
    best = Optimum(
        kind,
        top,
        _at_edge(here, asked),
        not _neighbours(here, asked) <= measured,
        len(found),
        _flat(kind, inside, 3),
        tuple(name for name in sliced if _flat(kind, _along(name, top, found), 2)),
    )
    return Slice(kind, x, y, held, sliced, inside, tuple(sorted(asked - measured)), best)


def _along(name: str, through: Point, points: list[Point]) -> tuple[Point, ...]:
    """The points that differ from one in this column at most."""
    others = {n: v for n, v in through.setting.items() if n != name}
    return tuple(p for p in points if agrees(p.setting, others))


def projected(matrix: Matrix, kind: str, x: Column, y: Column) -> Slice:
    """Every measured point over two columns, the others left as they are; no best but overall."""
    through = cut(matrix, kind, x, y)
    names = (x.name, y.name)
    inside = tuple(
        p
        for p in matrix.points
        if np.isfinite(p.power[kind]) and all(name in p.setting for name in names)
    )
    return through._replace(sliced={}, points=inside, missing=())


def by_spring(found: Matrix) -> dict[float, float]:
    """Stator position (%) of each measured spring rate (N/m), stiffest first."""
    stators = {p.spring_rate: p.stator for p in reversed(found.points)}
    return dict(sorted(stators.items(), reverse=True))


def optima(table: xarray.Dataset) -> list[Optimum]:
    """For each kind of power and each spring rate the measured point with the least power.

    Edges are those of all rows at that spring rate: one that is missing makes no new edge but a
    gap. Where more than spring rate, Kp and Ki varies, edge and gap are those of the slice through
    the best point.
    """
    found = matrix(table)
    slices = (
        cut(found, kind, KI, KP, {"spring_rate": rate})
        for kind in POWERS
        for rate in by_spring(found)
    )
    return [each.best for each in slices if each.best is not None]


def remarks(of: Slice) -> list[str]:
    """What a reader of the slice must know: that it is no even, full grid, and why."""
    if not of.points:
        return []
    xs, ys = (sorted(set(along)) for along in zip(*of.places, strict=True))
    said = []
    if len(of.points) < 3:
        said.append("1 point only" if len(of.points) == 1 else "2 points only")
    elif min(len(xs), len(ys)) > 1 and not spans_surface(of.places):
        said.append("points on one line")
    elif len(of.points) + len(of.missing) < len(xs) * len(ys):
        said.append("no full grid")
    if len(of.points) > 2:
        uneven = [c.label for c, along in ((of.x, xs), (of.y, ys)) if not _even(along)]
        said += [f"{' and '.join(uneven)} unevenly spaced"] if uneven else []
    if flat := _flat(of.kind, of.points, 3):
        said.append(f"all {flat}" if flat != WITHIN_ERRORS else _NO_SPREAD)
    if of.missing:
        many = len(of.missing)
        said.append(f"{many} point{'s' if many > 1 else ''} not measured (×)")
    return said


def _known(matrix: Matrix, name: str, value: float) -> float:
    """The value of the campaign that is meant; one that no row knows of is left as it is."""
    there = levels(matrix, name)
    near = [each for each in there if isclose(each, value, rel_tol=_SAME, abs_tol=1e-12)]
    if there and not near:
        of, digits = BY_NAME[name], 9
        known = ", ".join(quantity(of, each, digits) for each in there)
        raise ValueError(f"{of.label} is never {quantity(of, value, digits)}; there is {known}")
    return near[0] if near else value


def _flat(kind: str, points: tuple[Point, ...], least: int) -> str:
    """How little power differs at ``least`` points and more, in words; empty if it does differ.

    As far as their errors say (chi square, 99 %), or by so little that nobody would care.
    """
    if len(points) < least:
        return ""
    values = np.array([p.power[kind] for p in points])
    squares = np.array([p.error[kind] for p in points]) ** 2
    if np.isfinite(squares).all() and squares.all():
        dof = len(points) - 1
        if float(np.var(values, ddof=1) / squares.mean()) < float(chi2.ppf(0.99, dof)) / dof:
            return WITHIN_ERRORS
    return WITHIN_RELIEF if np.ptp(values) < LEAST_RELIEF * np.abs(values).max() else ""


def _even(values: list[float]) -> bool:
    steps = np.diff(values)
    return len(steps) < 2 or float(np.ptp(steps)) <= _EVEN * float(np.median(steps))


def _at_edge(here: Place, asked: set[Place]) -> bool:
    axes = [sorted(set(values)) for values in zip(*asked, strict=True)]
    return any(
        len(axis) >= _LEVELS and value in (axis[0], axis[-1])
        for value, axis in zip(here, axes, strict=True)
    )


def _neighbours(here: Place, asked: set[Place]) -> set[Place]:
    """The next places in the four directions along x and y, as many as there are."""
    found = set()
    for along, across in ((0, 1), (1, 0)):
        line = [place for place in asked if place[across] == here[across]]
        below = [place for place in line if place[along] < here[along]]
        above = [place for place in line if place[along] > here[along]]
        found |= {max(below)} if below else set()
        found |= {min(above)} if above else set()
    return found
