"""One panel of a picture of power: a surface over two columns, or a line where there is none.

Between measured points the surface is linear and passes through them; outside their hull nothing
is drawn, and a missing point is not a zero. More absorbed is darker. Points on one line are no
surface: they are drawn as a line, power upward.
"""

import textwrap
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import FigureBase
from matplotlib.patheffects import AbstractPathEffect, withStroke
from matplotlib.ticker import MaxNLocator

from rig.analysis import labels, phrases
from rig.analysis.mesh import Place, spans_surface, triangulation
from rig.analysis.picture import INK, MARK, ZERO, quiet
from rig.analysis.points import Point
from rig.analysis.slices import LEAST_RELIEF, Optimum, Slice, remarks

POWER = colormaps["YlGnBu_r"]  # low, the most absorbed, is dark blue; safe for colour-blind eyes
_STEPS = [1, 2, 2.5, 5, 10]
LETTERS = 17  # of a caption, an inch
_FLAT = 0.1  # W; less from end to end is drawn flat, not blown up to the whole scale

Drawn = Literal["surface", "line", "nothing"]


class Scale(NamedTuple):
    """Colours and contour levels that panels share."""

    levels: Any  # W, increasing
    colours: Colormap = POWER

    @property
    def norm(self) -> Normalize:
        """From power to colour."""
        return Normalize(self.levels[0], self.levels[-1])


def scale(values: Sequence[float], colours: Colormap = POWER, *, even: bool = False) -> Scale:
    """A scale that holds all values (W); ``even`` makes it reach as far either way from zero."""
    finite = [value for value in values if np.isfinite(value)] or [0.0]
    low, high = min(finite), max(finite)
    if even:
        high = max(abs(low), abs(high))
        low = -high
    else:
        low, high = _spread(low, high)
    if high - low < _FLAT:
        middle = 0.5 * (low + high)
        low, high = middle - 0.5, middle + 0.5
    return Scale(MaxNLocator(10).tick_values(low, high), colours)


def _spread(low: float, high: float) -> tuple[float, float]:
    """Ends of a scale of power, W, as far apart as differences that mean something."""
    short = 0.5 * max(0.0, LEAST_RELIEF * max(abs(low), abs(high)) - (high - low))
    return low - short, high + short


def surface(
    axes: Axes, places: Sequence[Place], values: Sequence[float], on: Scale, *, zero: bool = True
) -> None:
    """Colours and contours within the hull, the zero line if wanted, and the measured points."""
    mesh = triangulation(places)
    fine = np.linspace(on.levels[0], on.levels[-1], 8 * (len(on.levels) - 1) + 1)
    axes.tricontourf(mesh, list(values), levels=fine, cmap=on.colours, norm=on.norm)
    lines = [level for level in on.levels if min(values) < level < max(values)]
    if lines:
        style: dict[str, Any] = {"linewidths": 0.5, "linestyles": "solid", "alpha": 0.7}
        axes.tricontour(mesh, list(values), levels=lines, colors="white", **style)
    if zero and min(values) < 0.0 < max(values):
        nought = axes.tricontour(mesh, list(values), levels=[0.0], colors=ZERO, linewidths=1.6)
        halo: list[AbstractPathEffect] = [withStroke(linewidth=2.6, foreground=INK)]
        nought.set_path_effects(halo)
        for label in axes.clabel(nought, fmt="0 W", fontsize=7):
            label.set_path_effects(halo)
    x, y = zip(*places, strict=True)
    axes.plot(x, y, "o", mfc="white", mec=INK, mew=0.6, ms=3, clip_on=False)
    axes.use_sticky_edges = False
    axes.margins(0.05)


def mark(axes: Axes, x: float, y: float) -> None:
    """A star at the best point."""
    axes.plot(x, y, "*", ms=13, mfc=MARK, mec="white", mew=0.9, clip_on=False, zorder=5)


def along(of: Slice) -> int:
    """Which axis a line of points is drawn over: 0 for x, 1 for y."""
    xs, ys = zip(*of.places, strict=True)
    if len(set(xs)) == 1 or len(set(ys)) == 1:
        return int(len(set(ys)) > 1)
    return int(np.ptp(ys) / max(map(abs, ys)) > np.ptp(xs) / max(map(abs, xs)))


def _line(axes: Axes, of: Slice, best: Optimum) -> None:
    """Points on one line, be it a single one: power against the column that varies.

    What was not measured has no power: it is a cross on the axis.
    """
    which = along(of)
    column = (of.x, of.y)[which]
    times = labels.factor(column)
    order = np.argsort([place[which] for place in of.places])
    x = [of.places[i][which] * times for i in order]
    y = [of.points[i].power[of.kind] for i in order]
    errors = np.nan_to_num([of.points[i].error[of.kind] for i in order])
    axes.errorbar(x, y, yerr=errors, fmt="o-", color=INK, ms=3.5, lw=1.0, capsize=2)
    mark(axes, best.point.setting[column.name] * times, best.power)
    missing = [place[which] * times for place in of.missing]
    if missing:
        foot: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "clip_on": False}
        axes.plot(missing, [0.0] * len(missing), "x", color=INK, ms=4.5, mew=1.2, **foot)
    if len({*x, *missing}) == 1:
        room = 0.5 * abs(x[0]) or 1000.0
        axes.set_xlim(x[0] - room, x[0] + room)
    axes.set_ylim(_spread(*axes.get_ylim()))
    axes.set_xlabel(labels.heading(column), fontsize=8)
    axes.grid(alpha=0.3)


def scattered(axes: Axes, of: Slice, on: Scale) -> None:
    """Every point as a dot in its colour, whatever its other columns are; nothing between them."""
    quiet(axes)
    x, y = zip(*shown_places(of, of.places), strict=True)
    dots: dict[str, Any] = {"s": 30.0, "edgecolors": INK, "linewidths": 0.6, "clip_on": False}
    axes.scatter(x, y, c=of.values, cmap=on.colours, norm=on.norm, **dots)
    if of.best is not None:
        here = of.best.point.setting
        mark(axes, *shown_places(of, [(here[of.x.name], here[of.y.name])])[0])
        at = labels.settings({c.name: here[c.name] for c in (of.y, of.x)})
        axes.set_title(
            f"{phrases.watts(of.best.power, of.best.error)} at {at}\n"
            f"all {len(of.points)} points, their other columns differ: nothing is interpolated",
            fontsize=7.5,
            color=MARK,
            pad=4,
        )
    axes.set_ylabel(labels.heading(of.y), fontsize=8)
    axes.margins(0.05)
    ticks(axes)


def shown_places(of: Slice, places: Sequence[Place]) -> list[Place]:
    """Places in the units of the axes."""
    times_x, times_y = labels.factor(of.x), labels.factor(of.y)
    return [(x * times_x, y * times_y) for x, y in places]


def caption(of: Slice, room: float, *, compact: bool = False, sliced: bool = False) -> str:
    """What the best point gives and where it is, and on further lines what to know of the slice.

    ``room`` is the width of the panel (in); ``compact`` leaves out where, which a table says;
    ``sliced`` adds where the left-out columns stand, if no heading does.
    """
    best = of.best
    if best is None:
        return ""
    text = phrases.watts(best.power, best.error)
    if not compact:
        axes = (of.y, of.x)
        where = (f"{c.label} {_brief(c, best.point.setting[c.name])}" for c in axes)
        text += f" at {', '.join(where)}"
        text += f" ({best.doubt})" if best.doubt and not best.flat else ""
    lines = [text, "; ".join(remarks(of))]
    if sliced and of.sliced:
        lines.insert(1, f"sliced at {labels.settings(of.sliced)}")
    width = round(room * LETTERS)
    return "\n".join(part for line in lines for part in textwrap.wrap(line, width))


def _brief(column: Any, value: float) -> str:
    """Gains without their units, which the axes say; what is shown in other units with them."""
    number = labels.number(column, value)
    return number if column.name in ("kp", "ki") else f"{number} {labels.unit(column)}".rstrip()


def panel(axes: Axes, of: Slice, on: Scale | None, said: str, *, few: bool = False) -> Drawn:
    """Draw a slice, its best point marked, ``said`` above it; what it became is returned.

    ``few`` ticks where the panel is narrow.
    """
    quiet(axes)
    if of.best is None or on is None:
        axes.set_axis_off()
        axes.text(0.5, 0.5, "no value", transform=axes.transAxes, ha="center", color=INK)
        return "nothing"
    drawn: Drawn = "surface" if spans_surface(of.places) else "line"
    if drawn == "surface":
        surface(axes, shown_places(of, of.places), of.values, on)
        if of.missing:
            x, y = zip(*shown_places(of, of.missing), strict=True)
            (crosses,) = axes.plot(x, y, "x", color=INK, ms=4.5, mew=1.2, clip_on=False)
            crosses.set_path_effects([withStroke(linewidth=3.0, foreground="white")])
        here = of.best.point.setting
        mark(axes, *shown_places(of, [(here[of.x.name], here[of.y.name])])[0])
        place = axes.get_subplotspec()
        if place is None or place.is_last_row():
            axes.set_xlabel(labels.heading(of.x), fontsize=8)
        if place is None or place.is_first_col():
            axes.set_ylabel(labels.heading(of.y), fontsize=8)
    else:
        _line(axes, of, of.best)
    ticks(axes, few=few)
    axes.set_title(said, fontsize=7.5, color=MARK, pad=4)
    return drawn


def on_top(axes: Axes, of: Slice, others: Sequence[Point], on: Scale, drawn: Drawn) -> None:
    """Points of another table in a panel: squares, on a surface in the colours of its scale."""
    if not others or drawn == "nothing":
        return
    places = [(p.setting[of.x.name], p.setting[of.y.name]) for p in others]
    power = [p.power[of.kind] for p in others]
    look: dict[str, Any] = {"clip_on": False, "zorder": 6}  # a star does not hide them
    if drawn == "surface":
        x, y = zip(*shown_places(of, places), strict=True)
        look |= {"s": 42.0, "marker": "s", "edgecolors": MARK, "linewidths": 1.1}
        axes.scatter(x, y, c=power, cmap=on.colours, norm=on.norm, **look)
        return
    which = along(of)
    line = [shown_places(of, [place])[0][which] for place in places]
    errors = np.nan_to_num([p.error[of.kind] for p in others])
    axes.errorbar(
        line, power, yerr=errors, fmt="s", ms=8, mfc="none", color=MARK, capsize=2, **look
    )
    reach = np.array([power - errors, power + errors])
    low, high = axes.get_ylim()  # of the panel's own points
    least = np.min(reach, where=np.isfinite(reach), initial=low)
    most = np.max(reach, where=np.isfinite(reach), initial=high)
    room = 0.05 * (most - least)
    axes.set_ylim(least - room * (least < low), most + room * (most > high))


def ticks(axes: Axes, *, few: bool = False) -> None:
    """Round numbers along both axes, few enough to stand beside each other."""
    axes.xaxis.set_major_locator(MaxNLocator(3 if few else 5, steps=_STEPS))
    axes.yaxis.set_major_locator(MaxNLocator(5, steps=_STEPS))


def one_height(lines: list[Axes], label: str, *, each: bool) -> None:
    """Line plots of one kind of power on the same scale, labelled at the first or at each."""
    limits = np.array([axes.get_ylim() for axes in lines])
    room = 0.04 * (limits.max() - limits.min())
    for axes in lines:
        axes.set_ylim(limits.min() - room, limits.max() + room)
        axes.set_ylabel(label if each or axes is lines[0] else "", fontsize=8)


def colour_bar(figure: FigureBase, beside: list[Axes], on: Scale, label: str, **where: Any) -> None:
    """The colours of a scale beside the panels that use it."""
    place = {"fraction": 0.04, "pad": 0.02} | where
    bar = figure.colorbar(ScalarMappable(on.norm, on.colours), ax=beside, **place)
    bar.set_label(label, fontsize=8)
    bar.ax.tick_params(labelsize=7)
    bar.outline.set_visible(False)


def lines_of(captions: Sequence[str]) -> int:
    """Lines of the longest caption."""
    return max(text.count("\n") for text in captions) + 1


def above(axes: Axes, text: str, lines: int, *, compact: bool = False) -> None:
    """A panel's or column's heading, above a caption of so many lines."""
    axes.annotate(
        text,
        (0.5, 1.0),
        xycoords="axes fraction",
        xytext=(0, 8 + 11 * lines),
        textcoords="offset points",
        ha="center",
        fontsize=7.5 if compact else 9,
        fontweight="bold",
        color=INK,
    )
