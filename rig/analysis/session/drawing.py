"""What the figures of sessions share: axes, shades of blue, a line with its band, a note."""

from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure

from rig.analysis.picture import INK, quiet
from rig.analysis.session.linear_fit import Line, at, band

BLUE, RED, DEPTH = "#0b6e99", "#d1495b", "#2e933c"
CLOCKWISE, COUNTER = "#16222c", "#8f9aa3"  # black and grey, as the thesis has its directions
_BLUES = colormaps["Blues"]
_CORNERS = {
    "upper left": (0.02, 0.97),
    "upper right": (0.98, 0.97),
    "upper center": (0.5, 0.97),
    "lower left": (0.02, 0.03),
    "lower right": (0.98, 0.03),
}


def axes_of(body: SubFigure, x: str, y: str, axes: Axes | None = None) -> Axes:
    """Axes with labels and a grid that stand back behind what is shown."""
    made: Any = body.subplots() if axes is None else axes
    quiet(made)
    made.set_xlabel(x, fontsize=8.5)
    made.set_ylabel(y, fontsize=8.5)
    made.grid(alpha=0.25)
    found: Axes = made
    return found


def shade(index: int, count: int) -> Any:
    """A blue that darkens with the index."""
    return _BLUES(0.25 + 0.75 * index / max(1, count - 1))


def trend(axes: Axes, fitted: Line, over: Any, times: float = 1.0) -> None:
    """A line through points at x = ``over`` with its 95 % band, y multiplied by ``times``."""
    low, high = min(over), max(over)
    room = 0.05 * (high - low)
    x = np.linspace(low - room, high + room, 100)
    y, half = times * at(fitted, x), times * band(fitted, x)
    axes.fill_between(x, y - half, y + half, color=BLUE, alpha=0.15, lw=0)
    axes.plot(x, y, color=BLUE, lw=1.2)


def note(axes: Axes, text: str, where: str) -> None:
    """Words in a corner."""
    x, y = _CORNERS[where]
    down, side = where.split(" ")
    axes.text(
        x,
        y,
        text,
        transform=axes.transAxes,
        ha=side,
        va="top" if down == "upper" else "bottom",
        fontsize=8,
        color=INK,
        bbox={"fc": "white", "ec": "none", "alpha": 0.8, "pad": 2.0},
    )
