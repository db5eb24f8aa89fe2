"""Which measured points are neighbours, and what lies between them: linear, within their hull."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
from matplotlib.tri import TriAnalyzer, Triangulation

Place = tuple[float, float]  # x, y
Floats = npt.NDArray[np.float64]

_SLIVER = 0.15  # least ratio of inner to outer circle; a grid cell's half has 0.41
_FLAT = 1e-9  # relative extent below which points lie on one line


def _scaled(places: Sequence[Place]) -> Floats:
    """Places in units of their usual spacing: neither unit decides who is whose neighbour."""
    both = np.array(places, dtype=np.float64)
    steps = [np.diff(np.unique(along)) for along in both.T]
    usual = [float(np.median(step)) if len(step) else 1.0 for step in steps]
    return np.asarray((both - both.min(axis=0)) / np.array(usual))


def _ranked(places: Sequence[Place]) -> Floats:
    """Places by the number of their column and row, however far apart those are."""
    both = np.array(places, dtype=np.float64)
    ranks = [np.unique(along, return_inverse=True)[1] for along in both.T]
    return np.array(ranks, dtype=np.float64).T


def spans_surface(places: Sequence[Place]) -> bool:
    """Whether the places are at least three and not on one line."""
    if len(places) < 3:
        return False
    unit = _scaled(places)
    spread = np.linalg.svd(unit - unit.mean(axis=0), compute_uv=False)
    return bool(spread[1] > _FLAT * max(spread[0], 1.0))


def triangulation(places: Sequence[Place]) -> Triangulation:
    """Neighbourhood of places that span a surface.

    Slivers along the border, which join points that are no neighbours (a grid that was left half
    done), are masked. A long cell of an unevenly spaced grid is none: counted in columns and rows
    it is as short as the others.
    """
    unit = _scaled(places)
    mesh = Triangulation(unit[:, 0], unit[:, 1])
    flat = TriAnalyzer(mesh).get_flat_tri_mask(_SLIVER, rescale=False)
    rank = _ranked(places)
    by_rank = Triangulation(rank[:, 0], rank[:, 1], mesh.triangles)
    mask = flat & TriAnalyzer(by_rank).get_flat_tri_mask(_SLIVER, rescale=False)
    x, y = np.array(places, dtype=np.float64).T
    return Triangulation(x, y, mesh.triangles, None if np.all(mask) else mask)
