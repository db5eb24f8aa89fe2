"""Figures of sessions: the declaration of a figure, and the parts that several of them draw.

A figure is a function that draws data into axes, declared by `figure`; called with the data, it
returns the `FigureSpec` that the analysis draws and saves.
"""

from collections.abc import Callable, Iterator, Sequence
from functools import wraps
from pathlib import Path
from typing import Any, Concatenate, NamedTuple, ParamSpec, TypeVar

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import SubFigure

from rig.kinds.oswec_bench.products.estimate import Estimate, Line
from rig.presentation import picture
from rig.presentation.picture import DARK, style_axes

BLUE, RED, GREEN = "#0b6e99", "#d1495b", "#2e933c"
CLOCKWISE, COUNTER = "#16222c", "#8f9aa3"  # black and grey, the thesis's colours of the directions
_BLUES = colormaps["Blues"]

P = ParamSpec("P")
T = TypeVar("T")


class FigureSpec(NamedTuple):
    """A figure of the thesis, redrawn from the run."""

    name: str  # stem of its file name
    title: str
    caption: str
    size: tuple[float, float]  # in
    draw: Callable[[SubFigure], None]

    def save(self, attributes: dict[str, Any], folder: Path) -> Path:
        """Draw the figure in the frame of every result picture; return the path of its file."""
        framed, body = picture.framed_figure(*self.size, self.title, attributes, "", self.caption)
        self.draw(body)
        return picture.save(framed, folder / f"{self.name}.png")


def figure(
    title: str,
    caption: str | Callable[..., str],
    *,
    axes: tuple[str, ...],
    size: tuple[float, float] = (7.2, 4.4),
    height_ratios: tuple[float, ...] | None = None,
    share_x: bool = True,
    name: str = "",
) -> Callable[[Callable[Concatenate[Any, P], None]], Callable[P, FigureSpec]]:
    """Declare the figure that a function draws from its data; its file has the function's name.

    ``axes`` are the labels of x and y. The function's first argument is the axes; with several
    labels of y it is a list of axes from top to bottom, which have x in common unless ``share_x``
    is false. ``caption`` may be a function of the data.
    """
    x_label, *y_labels = axes

    def declare(draw: Callable[Concatenate[Any, P], None]) -> Callable[P, FigureSpec]:
        @wraps(draw)
        def specify(*args: P.args, **kwargs: P.kwargs) -> FigureSpec:
            def draw_body(body: SubFigure) -> None:
                shared = share_x and len(y_labels) > 1
                panels: Any = body.subplots(
                    len(y_labels), sharex=shared, height_ratios=height_ratios, squeeze=False
                )[:, 0]
                for panel, y_label in zip(panels, y_labels, strict=True):
                    last = panel is panels[-1]
                    _label_axes(panel, x_label if last or not shared else "", y_label)
                draw(panels[0] if len(panels) == 1 else list(panels), *args, **kwargs)

            text = caption if isinstance(caption, str) else caption(*args, **kwargs)
            return FigureSpec(name or draw.__name__, title, text, size, draw_body)

        return specify

    return declare


def _label_axes(axes: Axes, x_label: str, y_label: str) -> None:
    style_axes(axes)
    axes.set_xlabel(x_label, fontsize=8.5)
    axes.set_ylabel(y_label, fontsize=8.5)
    axes.grid(alpha=0.25)


def shade(index: int, count: int) -> Any:
    """Return a blue that darkens with the index."""
    return _BLUES(0.25 + 0.75 * index / max(1, count - 1))


def shaded(items: Sequence[T]) -> Iterator[tuple[T, Any]]:
    """Yield each item with its blue, later ones darker, the first one dark enough for points."""
    for i, each in enumerate(items):
        yield each, shade(i + 1, len(items) + 1)


def legend(axes: Axes, loc: Any = "best", **style: Any) -> None:
    """Add the legend of every figure, without a frame."""
    if "title" in style:
        style["title_fontsize"] = 8
    axes.legend(frameon=False, fontsize=8, loc=loc, **style)


def draw_trend(axes: Axes, line: Line, points_x: Any, factor: float = 1.0) -> None:
    """Draw a line over the range of ``points_x`` with its 95 % band, y multiplied by ``factor``."""
    low, high = min(points_x), max(points_x)
    margin = 0.05 * (high - low)
    x = np.linspace(low - margin, high + margin, 100)
    y, half_width = factor * line.at(x), factor * line.band(x)
    axes.fill_between(x, y - half_width, y + half_width, color=BLUE, alpha=0.15, lw=0)
    axes.plot(x, y, color=BLUE, lw=1.2)


def draw_percentiles(axes: Axes, x: float, values: Any, **style: Any) -> None:
    """Draw the mean of ``values``, with bars to their 5th and 95th percentile."""
    mid = values.mean()
    low, high = np.percentile(values, [5, 95])
    axes.errorbar(x, mid, [[mid - low], [high - mid]], fmt="o", **style)


def draw_intervals(axes: Axes, x: Any, estimates: list[Estimate], **style: Any) -> None:
    """Draw values with their 95 % intervals, as far as these are known."""
    values, half_widths = zip(*((each.value, each.uncertainty) for each in estimates), strict=True)
    axes.errorbar(x, values, np.nan_to_num(half_widths), fmt="o", ms=4, capsize=2.5, **style)


def annotate_corner(axes: Axes, text: str, corner: str) -> None:
    """Write a text into a corner of the axes, such as ``upper left``, or the ``upper center``."""
    vertical, horizontal = corner.split(" ")
    axes.text(
        {"left": 0.02, "center": 0.5, "right": 0.98}[horizontal],
        {"upper": 0.97, "lower": 0.03}[vertical],
        text,
        transform=axes.transAxes,
        ha=horizontal,
        va="top" if vertical == "upper" else "bottom",
        fontsize=8,
        color=DARK,
        bbox={"fc": "white", "ec": "none", "alpha": 0.8, "pad": 2.0},
    )
