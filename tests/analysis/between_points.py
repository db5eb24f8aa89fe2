"""What a drawn surface shows between its points, read off the triangles it is drawn with."""

from collections.abc import Sequence

from matplotlib.tri import LinearTriInterpolator

from rig.analysis.mesh import Place, triangulation


def interpolator(places: Sequence[Place], values: Sequence[float]) -> LinearTriInterpolator:
    """The value as a function of (x, y), masked outside the hull of the places."""
    return LinearTriInterpolator(triangulation(places), list(values))
