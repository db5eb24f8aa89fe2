"""Interpolation of a drawn surface between its points, with the same triangulation."""

from collections.abc import Sequence

from matplotlib.tri import LinearTriInterpolator

from rig.analysis.slices import XY, triangulate


def interpolator(places: Sequence[XY], values: Sequence[float]) -> LinearTriInterpolator:
    """Return the value as a function of (x, y), masked outside the convex hull of the points."""
    return LinearTriInterpolator(triangulate(places), list(values))
