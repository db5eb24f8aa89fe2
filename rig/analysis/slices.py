"""Slices of a gain matrix: power over two columns at fixed values of the others.

A matrix of more than two columns is sliced through the point where a station absorbs most: every
other column has its value at that point (MASK4 report (Sandia), section 4.3). Each station
therefore has its own slice.
"""

from collections.abc import Sequence
from math import isclose
from typing import Any, NamedTuple

import numpy as np
import xarray
from matplotlib.tri import CubicTriInterpolator, TriAnalyzer, Triangulation, UniformTriRefiner
from scipy.special import gammaincinv

from rig.analysis.labels import format_quantity, panel_title
from rig.analysis.points import (
    PERCENT,
    Matrix,
    Point,
    Setting,
    agrees,
    gain_matrix,
    levels,
    varied_columns,
)
from rig.analysis.ranking import not_worse
from rig.row_contents import LAW, Column, X, Y, find_column, with_role
from rig.spectra.periods import Floats
from rig.stations import Station, find

XY = tuple[float, float]  # x, y

_MIN_CIRCLE_RATIO = 0.15  # of inscribed to circumscribed circle; half a square grid cell has 0.41
_COLLINEAR_EXTENT = 1e-9  # relative extent below which points are collinear


def _scale_by_spacing(points: Sequence[XY]) -> Floats:
    """Return the points in units of their median spacing, so that units do not affect the mesh."""
    coordinates = np.array(points, dtype=np.float64)
    steps = [np.diff(np.unique(axis)) for axis in coordinates.T]
    spacing = [float(np.median(step)) if len(step) else 1.0 for step in steps]
    return np.asarray((coordinates - coordinates.min(axis=0)) / np.array(spacing))


def _grid_indices(points: Sequence[XY]) -> Floats:
    """Return the points by column and row number, regardless of the spacing."""
    coordinates = np.array(points, dtype=np.float64)
    ranks = [np.unique(axis, return_inverse=True)[1] for axis in coordinates.T]
    return np.array(ranks, dtype=np.float64).T


def spans_surface(points: Sequence[XY]) -> bool:
    """Return whether there are at least three points that are not collinear."""
    if len(points) < 3:
        return False
    scaled = _scale_by_spacing(points)
    spread = np.linalg.svd(scaled - scaled.mean(axis=0), compute_uv=False)
    return bool(spread[1] > _COLLINEAR_EXTENT * max(spread[0], 1.0))


def triangulate(points: Sequence[XY]) -> Triangulation:
    """Return the triangulation of points that span a surface.

    Thin triangles along the border are masked: they connect points that are not neighbours, as in a
    half-finished grid. A long cell of an unevenly spaced grid stays, because it is as short as the
    others when counted in columns and rows.
    """
    scaled = _scale_by_spacing(points)
    mesh = Triangulation(scaled[:, 0], scaled[:, 1])
    thin = TriAnalyzer(mesh).get_flat_tri_mask(_MIN_CIRCLE_RATIO, rescale=False)
    indices = _grid_indices(points)
    index_mesh = Triangulation(indices[:, 0], indices[:, 1], mesh.triangles)
    mask = thin & TriAnalyzer(index_mesh).get_flat_tri_mask(_MIN_CIRCLE_RATIO, rescale=False)
    x, y = np.array(points, dtype=np.float64).T
    return Triangulation(x, y, mesh.triangles, None if np.all(mask) else mask)


_MIN_SMOOTH = 5  # points of a surface: fewer do not show its shape
_SUBDIVISIONS = 3  # of a triangle's sides, each in halves
_CELLS = 120  # along each axis, of a picture of cells


def is_smooth(xy: Sequence[XY]) -> bool:
    """Return whether points suffice for contours: five, with three values along an axis."""
    levels = [len(set(axis)) for axis in zip(*xy, strict=True)]
    return len(xy) >= _MIN_SMOOTH and max(levels) >= 3


def interpolate(xy: Sequence[XY], values: Sequence[float]) -> tuple[Triangulation, Floats]:
    """Return a fine mesh over the triangles of the points, and the values at its points.

    The interpolation is cubic, goes through every point, and never leaves the range of the values;
    the mesh never leaves the triangles. Points that are closer along one axis count as close as
    their neighbours along the other.
    """
    mesh, indices = triangulate(xy), _grid_indices(xy)
    even = Triangulation(indices[:, 0], indices[:, 1], mesh.triangles, mesh.mask)
    fine, field = UniformTriRefiner(even).refine_field(
        np.asarray(values, dtype=np.float64), CubicTriInterpolator(even, values, kind="geom"),
        subdiv=_SUBDIVISIONS,
    )  # fmt: skip
    x, y = (
        np.interp(numbers, np.arange(len(levels)), levels)
        for numbers, levels in zip((fine.x, fine.y), _levels_of(xy), strict=True)
    )
    bounded = np.clip(field, min(values), max(values))
    return Triangulation(x, y, fine.triangles, fine.mask), np.asarray(bounded)


def _levels_of(xy: Sequence[XY]) -> list[Floats]:
    """Return the values along each axis, rising."""
    return [np.unique(np.array(axis, dtype=np.float64)) for axis in zip(*xy, strict=True)]


def nearest_cells(xy: Sequence[XY], values: Sequence[float]) -> tuple[Floats, Floats, Any]:
    """Return x and y of a fine grid and the value of the nearest point; masked beyond the hull."""
    points, mesh = np.array(xy, dtype=np.float64), triangulate(xy)
    low, span = points.min(axis=0), np.ptp(points, axis=0)
    x, y = (np.linspace(a, a + b, _CELLS) for a, b in zip(low, span, strict=True))
    grid = np.stack(np.meshgrid(x, y), axis=-1)
    steps = (grid[:, :, None, :] - points) / span
    nearest = np.sum(steps**2, axis=-1).argmin(axis=-1)
    triangles = np.asarray(mesh.get_trifinder()(grid[..., 0], grid[..., 1]))
    return x, y, np.ma.masked_array(np.array(values)[nearest], triangles < 0)


_VALUE_TOLERANCE = 1e-6  # relative; values closer than this are equal
_STEP_TOLERANCE = 0.01  # relative to the step; steps closer than this are equal
NEGLIGIBLE_SHARE = 0.01  # of the power; smaller differences are irrelevant
_MIN_LEVELS = 3  # of a column, so that a level can lie inside its range

WITHIN_ERRORS = "within errors"
WITHIN_SHARE = f"within {100.0 * NEGLIGIBLE_SHARE:g} %"
UNDECIDED = "undecided"
ENDED_EARLY = "ended early"  # by the judgement of another station
_NO_SPREAD = "differences within errors"


class Optimum(NamedTuple):
    """The measured point that absorbs most at one station."""

    station: Station
    point: Point
    at_edge: bool  # end of a range of at least three values: the optimum may lie outside
    at_gap: bool  # a neighbouring point was not measured: the optimum may lie there
    points: int  # number of measured points compared
    flat: str  # range within which all points of the slice lie; empty if they differ
    without_effect: tuple[str, ...]  # sliced columns along which power does not change
    alike: tuple[Point, ...] | None = ()
    """The other points that cannot be distinguished from it; None where errors are unknown."""

    @property
    def caveat(self) -> str:
        """Short remark if the true optimum may lie elsewhere; empty otherwise.

        Edge and gap mean nothing where the points of the slice do not differ.
        """
        if self.flat:
            return self.flat
        edge = "grid's edge" if self.at_edge else "next to a gap" if self.at_gap else ""
        known = UNDECIDED if self.alike is None else f"1 of {1 + len(self.alike)} alike"
        cut = ENDED_EARLY if self.point.cut_rows else ""
        return "; ".join(filter(None, (known if self.alike != () else "", cut, edge)))

    @property
    def power(self) -> float:
        """W, negative is absorbed."""
        return self.point.power[self.station.name]

    @property
    def error(self) -> float:
        """Standard error, W; NaN where unknown."""
        return self.point.error[self.station.name]

    @property
    def power_text(self) -> str:
        """The power with its standard error, or with its expanded uncertainty by a budget."""
        return self.point.power_text(self.station.name)

    @property
    def caption(self) -> str:
        """The same, with the confidence of the expanded uncertainty."""
        is_interval = np.isfinite(self.error) and self.station.name in self.point.type_b
        return f"{self.power_text} ({PERCENT})" if is_interval else self.power_text


class Slice(NamedTuple):
    """The points of a matrix over two columns for the power at one station."""

    station: Station
    x: Column
    y: Column
    fixed: Setting  # columns at a requested value
    sliced: Setting  # other columns, at the value of the best point
    points: tuple[Point, ...]  # measured points of the slice with a finite power
    missing: tuple[XY, ...]  # planned points of the slice that were not measured
    best: Optimum | None  # None if nothing was measured
    columns: tuple[Column, ...]  # of the matrix

    @property
    def xy(self) -> list[XY]:
        """x and y of each point."""
        return [(p.setting[self.x.name], p.setting[self.y.name]) for p in self.points]

    @property
    def values(self) -> list[float]:
        """Power of each point, W."""
        return [p.power[self.station.name] for p in self.points]


def points_over(
    matrix: Matrix, name: str, axes: tuple[Column, Column], fixed: Setting
) -> list[Point]:
    """Return the measured points with both axes, these values, and a finite power of a station."""
    return [
        p
        for p in matrix.points
        if agrees(p.setting, fixed)
        and np.isfinite(p.power[name])
        and all(axis.name in p.setting for axis in axes)
    ]


def slice_matrix(
    matrix: Matrix, name: str, x: Column, y: Column, fixed: Setting | None = None
) -> Slice:
    """Return the slice of a station's power through the best of the points with these values.

    Raises ValueError for a value that is not in the campaign; the message lists those that are.
    """
    station = find(matrix.stations, name)
    fixed = {n: _campaign_value(matrix, n, v) for n, v in (fixed or {}).items() if np.isfinite(v)}
    points = points_over(matrix, name, (x, y), fixed)
    if not points:
        return Slice(station, x, y, fixed, {}, (), (), None, matrix.columns)
    best_point = min(points, key=lambda point: point.power[name])
    left_out = {c.name for c in varied_columns(matrix)} - {x.name, y.name, *fixed}
    sliced = {n: v for n, v in best_point.setting.items() if n in left_out}
    in_slice = tuple(p for p in points if agrees(p.setting, sliced))
    planned = {
        (s[x.name], s[y.name])
        for s in matrix.planned
        if agrees(s, fixed | sliced) and x.name in s and y.name in s
    }
    measured = {(p.setting[x.name], p.setting[y.name]) for p in in_slice}
    best_xy = (best_point.setting[x.name], best_point.setting[y.name])
    best = Optimum(
        station,
        best_point,
        _at_edge(best_xy, planned),
        not _neighbours(best_xy, planned) <= measured,
        len(points),
        _flatness(name, in_slice, 3),
        tuple(n for n in sliced if _flatness(name, _points_along(n, best_point, points), 2)),
        not_worse(points, best_point, name),
    )
    missing = tuple(sorted(planned - measured))
    return Slice(station, x, y, fixed, sliced, in_slice, missing, best, matrix.columns)


def _points_along(name: str, origin: Point, points: list[Point]) -> tuple[Point, ...]:
    """Return the points that differ from ``origin`` at most in this column."""
    others = {n: v for n, v in origin.setting.items() if n != name}
    return tuple(p for p in points if agrees(p.setting, others))


def project_matrix(matrix: Matrix, name: str, x: Column, y: Column) -> Slice:
    """Return all measured points over two columns, whatever their other columns.

    The best point is that of the whole matrix.
    """
    points = tuple(points_over(matrix, name, (x, y), {}))
    return slice_matrix(matrix, name, x, y)._replace(sliced={}, points=points, missing=())


class Panel(NamedTuple):
    """A value of the panel column: the set points of one panel of a picture."""

    fixed: Setting  # empty for a matrix without a panel column
    title: str


def panels(matrix: Matrix) -> list[Panel]:
    """Return a panel for each measured value of the panel column, the highest first."""
    column = matrix.panel
    if column is None:
        return [Panel({}, "")]
    by_value = {p.setting.get(column.name, float("nan")): p for p in reversed(matrix.points)}
    return [
        Panel({column.name: value}, panel_title(column, point))
        for value, point in sorted(by_value.items(), key=lambda item: item[0], reverse=True)
    ]


def law_axes(matrix: Matrix) -> tuple[Column, Column]:
    """Return the axes x and y of a panel: those of the run, or its law's first two columns."""
    x, y = (with_role(matrix.columns, role) for role in (X, Y))
    if x is not None and y is not None:
        return x, y
    first, second, *_ = sorted(matrix.columns, key=lambda column: column.role != LAW)
    return first, second


def find_optima(table: xarray.Dataset) -> list[Optimum]:
    """Return the measured point that absorbs most, for each station and panel.

    The edges are those of all planned rows of that panel: a missing row is a gap, not a new
    edge. Where other than the main columns vary, edge and gap are those of the slice through the
    best point.
    """
    matrix = gain_matrix(table)
    slices = (
        slice_matrix(matrix, station.name, *law_axes(matrix), each.fixed)
        for station in matrix.stations
        for each in panels(matrix)
    )
    return [found.best for found in slices if found.best is not None]


def best_optima(table: xarray.Dataset) -> dict[str, Optimum]:
    """Return the best of `find_optima` over all panels, by name of the station."""
    best: dict[str, Optimum] = {}
    for each in find_optima(table):
        known = best.setdefault(each.station.name, each)
        if each.power < known.power:
            best[each.station.name] = each
    return best


def is_too_sparse(slice_: Slice) -> bool:
    """Return whether a slice of a planned surface has too few measured points for one."""
    return not spans_surface(slice_.xy) and spans_surface([*slice_.xy, *slice_.missing])


def slice_remarks(slice_: Slice) -> list[str]:
    """Return remarks on the slice: why it is not a full, evenly spaced grid."""
    if not slice_.points:
        return []
    xs, ys = (sorted(set(values)) for values in zip(*slice_.xy, strict=True))
    remarks = []
    if is_too_sparse(slice_):
        remarks.append(f"{len(slice_.points)} of {len(slice_.points) + len(slice_.missing)} points")
    elif len(slice_.points) < 3:
        remarks.append("1 point only" if len(slice_.points) == 1 else "2 points only")
    elif min(len(xs), len(ys)) > 1 and not spans_surface(slice_.xy):
        remarks.append("points on one line")
    elif len(slice_.points) + len(slice_.missing) < len(xs) * len(ys):
        remarks.append("incomplete grid")
    if len(slice_.points) > 2:
        uneven = [c.label for c, values in ((slice_.x, xs), (slice_.y, ys)) if not _is_even(values)]
        remarks += [f"{' and '.join(uneven)} unevenly spaced"] if uneven else []
    if flatness := _flatness(slice_.station.name, slice_.points, 3):
        remarks.append(f"all {flatness}" if flatness != WITHIN_ERRORS else _NO_SPREAD)
    if slice_.missing and not is_too_sparse(slice_):
        count = len(slice_.missing)
        remarks.append(f"{count} point{'s' if count > 1 else ''} not measured (×)")
    return remarks


def _campaign_value(matrix: Matrix, name: str, value: float) -> float:
    """Return the campaign's value closest to a requested one.

    A column without values in the campaign returns the value unchanged. Raises ValueError for a
    value that is not in the campaign.
    """
    campaign_levels = levels(matrix, name)
    matching = [
        each
        for each in campaign_levels
        if isclose(each, value, rel_tol=_VALUE_TOLERANCE, abs_tol=1e-12)
    ]
    if campaign_levels and not matching:
        column, digits = find_column(matrix.columns, name), 9
        available = ", ".join(format_quantity(column, each, digits) for each in campaign_levels)
        shown = format_quantity(column, value, digits)
        raise ValueError(f"{column.label} {shown} is not in the campaign; allowed {available}")
    return matching[0] if matching else value


def _flatness(name: str, points: tuple[Point, ...], min_points: int) -> str:
    """Return the range within which the powers of the points lie as text; empty if they differ.

    Powers do not differ if their variance is within their errors (chi square, 99 %), or if their
    range is a negligible share of the power. Fewer than ``min_points`` points count as different.
    """
    if len(points) < min_points:
        return ""
    values = np.array([p.power[name] for p in points])
    squares = np.array([p.error[name] for p in points]) ** 2
    # Of errors that all points share, only the differences of the contributions count.
    squares += np.sum(np.var([p.contributions(name) for p in points], axis=0, ddof=1))
    if np.isfinite(squares).all() and squares.all():
        dof = len(points) - 1
        chi_square = 2.0 * float(gammaincinv(0.5 * dof, 0.99))  # its 99 % quantile
        if float(np.var(values, ddof=1) / squares.mean()) < chi_square / dof:
            return WITHIN_ERRORS
    return WITHIN_SHARE if np.ptp(values) < NEGLIGIBLE_SHARE * np.abs(values).max() else ""


def _is_even(values: list[float]) -> bool:
    steps = np.diff(values)
    return len(steps) < 2 or float(np.ptp(steps)) <= _STEP_TOLERANCE * float(np.median(steps))


def _at_edge(xy: XY, planned: set[XY]) -> bool:
    axes = [sorted(set(values)) for values in zip(*planned, strict=True)]
    return any(
        len(axis) >= _MIN_LEVELS and value in (axis[0], axis[-1])
        for value, axis in zip(xy, axes, strict=True)
    )


def _neighbours(xy: XY, planned: set[XY]) -> set[XY]:
    """Return the nearest planned points in both directions along x and y."""
    neighbours = set()
    for axis, other_axis in ((0, 1), (1, 0)):
        line = [neighbour for neighbour in planned if neighbour[other_axis] == xy[other_axis]]
        below = [neighbour for neighbour in line if neighbour[axis] < xy[axis]]
        above = [neighbour for neighbour in line if neighbour[axis] > xy[axis]]
        neighbours |= {max(below)} if below else set()
        neighbours |= {min(above)} if above else set()
    return neighbours
