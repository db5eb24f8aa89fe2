"""Shared parts of the figures of sessions: axes, shades of blue, a line with its band, a corner
note.
"""

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure

from rig.kinds.oswec_bench.products.linear_fit import Line, band, value_at
from rig.presentation.picture import DARK, style_axes

BLUE, RED, GREEN = "#0b6e99", "#d1495b", "#2e933c"
CLOCKWISE, COUNTER = "#16222c", "#8f9aa3"  # black and grey, the thesis's colours of the directions
_BLUES = colormaps["Blues"]
_CORNERS = {
    "upper left": (0.02, 0.97),
    "upper right": (0.98, 0.97),
    "upper center": (0.5, 0.97),
    "lower left": (0.02, 0.03),
    "lower right": (0.98, 0.03),
}


def prepare_axes(body: SubFigure, x_label: str, y_label: str, axes: Axes | None = None) -> Axes:
    """Return axes with labels, and a grid in the background; ``axes`` reuses existing ones."""
    new_axes: Any = body.subplots() if axes is None else axes
    style_axes(new_axes)
    new_axes.set_xlabel(x_label, fontsize=8.5)
    new_axes.set_ylabel(y_label, fontsize=8.5)
    new_axes.grid(alpha=0.25)
    styled: Axes = new_axes
    return styled


def shade(index: int, count: int) -> Any:
    """Return a blue that darkens with the index."""
    return _BLUES(0.25 + 0.75 * index / max(1, count - 1))


def draw_trend(axes: Axes, line: Line, points_x: Any, factor: float = 1.0) -> None:
    """Draw a line over the range of ``points_x`` with its 95 % band, y multiplied by ``factor``."""
    low, high = min(points_x), max(points_x)
    margin = 0.05 * (high - low)
    x = np.linspace(low - margin, high + margin, 100)
    y, half_width = factor * value_at(line, x), factor * band(line, x)
    axes.fill_between(x, y - half_width, y + half_width, color=BLUE, alpha=0.15, lw=0)
    axes.plot(x, y, color=BLUE, lw=1.2)


def annotate_corner(axes: Axes, text: str, corner: str) -> None:
    """Write a text into a corner of the axes."""
    x, y = _CORNERS[corner]
    vertical, horizontal = corner.split(" ")
    axes.text(
        x,
        y,
        text,
        transform=axes.transAxes,
        ha=horizontal,
        va="top" if vertical == "upper" else "bottom",
        fontsize=8,
        color=DARK,
        bbox={"fc": "white", "ec": "none", "alpha": 0.8, "pad": 2.0},
    )
