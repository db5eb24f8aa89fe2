"""Triangulation of measured points, for linear interpolation within their convex hull."""

from collections.abc import Sequence

import numpy as np
from matplotlib.tri import TriAnalyzer, Triangulation

from rig.spectra.periods import Floats

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
