"""One panel of a power picture: a surface over two columns, or a line plot for collinear points.

The surface goes through the measured points, smooth between them, and ends at their convex hull; a
missing point is not drawn as zero. With too few points for a surface, each one colours the region
nearest to it. Darker colours mean more absorbed power. Collinear points are
drawn as a line plot with power on the vertical axis.
"""

import textwrap
from collections.abc import Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import FigureBase
from matplotlib.lines import Line2D
from matplotlib.patheffects import AbstractPathEffect, withStroke
from matplotlib.ticker import MaxNLocator

from rig.analysis import labels
from rig.analysis.points import Point
from rig.analysis.slices import (
    NEGLIGIBLE_SHARE,
    XY,
    Optimum,
    Slice,
    interpolate,
    is_smooth,
    is_too_sparse,
    nearest_cells,
    slice_remarks,
    spans_surface,
)
from rig.presentation.picture import ACCENT, DARK, HIGHLIGHT, for_paper, style_axes
from rig.row_contents import Column, X, Y

POWER_COLOURS = colormaps["YlGnBu_r"]  # most absorbed is dark blue; safe for colour-blind readers
_STEPS = [1, 2, 2.5, 5, 10]
CAPTION_LETTERS = 17  # per inch
_MIN_SPAN = 0.1  # W; a smaller range is drawn flat, not stretched over the whole scale
_ROUNDING = 1.0e-9  # W

PanelContent = Literal["surface", "line", "nothing"]


class Scale(NamedTuple):
    """Colours and contour levels shared by panels."""

    levels: Any  # W, increasing
    colours: Colormap = POWER_COLOURS

    @property
    def norm(self) -> Normalize:
        """Normalisation from power to colour."""
        return Normalize(self.levels[0], self.levels[-1])


def power_scale(
    values: Sequence[float], colours: Colormap = POWER_COLOURS, *, symmetric: bool = False
) -> Scale:
    """Return a scale that contains all values (W); ``symmetric`` centres it on zero."""
    finite = [value for value in values if np.isfinite(value)] or [0.0]
    low, high = min(finite), max(finite)
    if symmetric:
        high = max(abs(low), abs(high))
        low = -high
    else:
        low, high = _widen(low, high)
    small = not symmetric and _ROUNDING < max(abs(low), abs(high)) < _MIN_SPAN
    if high - low < _MIN_SPAN and not small:  # of small powers a share of them is drawn
        middle = 0.5 * (low + high)
        low, high = middle - 0.5, middle + 0.5
    return Scale(MaxNLocator(10).tick_values(low, high), colours)


def _widen(low: float, high: float) -> tuple[float, float]:
    """Return the ends of a power scale (W), widened to at least the smallest relevant range."""
    shortfall = 0.5 * max(0.0, NEGLIGIBLE_SHARE * max(abs(low), abs(high)) - (high - low))
    return low - shortfall, high + shortfall


def draw_surface(
    axes: Axes,
    xy: Sequence[XY],
    values: Sequence[float],
    colour_scale: Scale,
    *,
    zero_line: bool = True,
) -> None:
    """Draw colours and contours within the hull, the zero line and the measured points.

    Contours need enough points (`slices.is_smooth`).
    """
    levels, colours, norm = colour_scale.levels, colour_scale.colours, colour_scale.norm
    smooth = is_smooth(xy)
    if smooth:
        mesh, field = interpolate(xy, values)
        # An image of colours: edges between filled contours would show as white lines in a PDF.
        axes.tripcolor(mesh, field, cmap=colours, norm=norm, shading="gouraud", rasterized=True)
        lines = [level for level in levels if min(values) < level < max(values)]
        if lines:
            style: dict[str, Any] = {"linewidths": 0.5, "linestyles": "solid", "alpha": 0.7}
            axes.tricontour(mesh, field, levels=lines, colors="white", **style)
    else:
        axes.pcolormesh(
            *nearest_cells(xy, values), cmap=colours, norm=norm, shading="nearest", rasterized=True
        )
    if smooth and zero_line and min(values) < 0.0 < max(values):
        zero_contour = axes.tricontour(mesh, field, levels=[0.0], colors=HIGHLIGHT, linewidths=1.6)
        halo: list[AbstractPathEffect] = [withStroke(linewidth=2.6, foreground=DARK)]
        zero_contour.set_path_effects(halo)
        for label in axes.clabel(zero_contour, fmt="0 W", fontsize=7):
            label.set_path_effects(halo)
    x, y = zip(*xy, strict=True)
    axes.plot(x, y, "o", mfc="white", mec=DARK, mew=0.6, ms=2 if for_paper() else 3, clip_on=False)
    axes.use_sticky_edges = False
    axes.margins(0.05)


_ALIKE: dict[str, Any] = {
    **{"ls": "", "marker": "o", "ms": 9, "mfc": "none", "mec": ACCENT, "mew": 1.4},
    **{"clip_on": False, "zorder": 4},
}
"""A ring: the power there cannot be distinguished from that of the best point."""


_CUT: dict[str, Any] = {
    **{"ls": "", "marker": "v", "mfc": "white", "mec": DARK, "mew": 1.1},
    **{"clip_on": False, "zorder": 5.5},
}
"""A hollow triangle in place of the dot, above the star of a best point: a row there ended because
it could not be the best.
"""


def _cut_size() -> float:
    return 4.5 if for_paper() else 6.5


def _mark_cut(axes: Axes, places: Sequence[XY]) -> None:
    if places:
        axes.plot(*zip(*places, strict=True), ms=_cut_size(), **_CUT)


def add_cut_legend(figure: FigureBase, text: str) -> None:
    """Add the meaning of the triangle below the panels; nothing for an empty text."""
    if text:
        label = textwrap.fill(text, 48 if for_paper() else 100)
        handle = Line2D([], [], label=label, ms=_cut_size(), **_CUT)
        figure.legend(handles=[handle], loc="outside lower center", fontsize=7.5, frameon=False)


def mark_best(axes: Axes, x: float, y: float) -> None:
    """Draw a star at the best point."""
    axes.plot(
        x,
        y,
        "*",
        ms=8 if for_paper() else 13,
        mfc=ACCENT,
        mec="white",
        mew=0.9,
        clip_on=False,
        zorder=5,
    )


def mark_match(axes: Axes, slice_: Slice, match: Mapping[str, float]) -> None:
    """Mark gains that match the plant's impedance Z, where a surface over Kp and Ki has them.

    ``match`` has ``kp`` and ``ki`` of the complex conjugate, and ``kp_real`` of -|Z| (Ki = 0).
    """
    if not match or not spans_surface(slice_.xy) or {slice_.x.name, slice_.y.name} != {"kp", "ki"}:
        return
    for kp, ki, label in (
        (match["kp"], match["ki"], "−Z*"),
        (match["kp_real"], 0.0, "−|Z|"),
    ):
        place = {"kp": kp, "ki": ki}
        xy = (place[slice_.x.name], place[slice_.y.name])
        spans = zip(*slice_.xy, strict=True)
        if not all(min(span) <= v <= max(span) for v, span in zip(xy, spans, strict=True)):
            continue  # of a match outside the grid the edge of the surface says enough
        (shown,) = display_xy(slice_, [xy])
        halo: list[AbstractPathEffect] = [withStroke(linewidth=2.6, foreground="white")]
        style: dict[str, Any] = {"color": DARK, "path_effects": halo, "zorder": 7}
        axes.plot(*shown, "+", ms=9, mew=1.6, **style)
        axes.annotate(label, shown, xytext=(5, 4), textcoords="offset points", fontsize=8, **style)


def _mark_optimum(axes: Axes, slice_: Slice, best: Optimum) -> None:
    place = (best.point.setting[slice_.x.name], best.point.setting[slice_.y.name])
    if alike := [p for p in best.alike or () if p in slice_.points]:
        names = slice_.x.name, slice_.y.name
        places = display_xy(slice_, [(p.setting[names[0]], p.setting[names[1]]) for p in alike])
        axes.plot(*zip(*places, strict=True), **_ALIKE)
    mark_best(axes, *display_xy(slice_, [place])[0])


def set_caption(axes: Axes, text: str) -> None:
    """Set the text directly above a panel; pictures for papers have none."""
    if for_paper():
        return
    axes.set_title(text, fontsize=7.5, color=ACCENT, pad=4)


def line_axis(slice_: Slice) -> int:
    """Return the horizontal axis for a line of points: 0 for x, 1 for y."""
    xs, ys = zip(*slice_.xy, strict=True)
    if len(set(xs)) == 1 or len(set(ys)) == 1:
        return int(len(set(ys)) > 1)
    return int(np.ptp(ys) / max(map(abs, ys)) > np.ptp(xs) / max(map(abs, xs)))


def _draw_line(axes: Axes, slice_: Slice, best: Optimum) -> None:
    """Draw collinear points, or a single one: power against the column that varies.

    Crosses on the axis mark points that were not measured.
    """
    axis = line_axis(slice_)
    column = (slice_.x, slice_.y)[axis]
    factor = labels.display_factor(column)
    order = np.argsort([coordinates[axis] for coordinates in slice_.xy])
    x = [slice_.xy[i][axis] * factor for i in order]
    y = [slice_.points[i].power[slice_.station.name] for i in order]
    errors = np.nan_to_num([slice_.points[i].shown_error(slice_.station.name) for i in order])
    axes.errorbar(x, y, yerr=errors, fmt="o-", color=DARK, ms=3.5, lw=1.0, capsize=2)
    cut = [i for i in range(len(order)) if slice_.points[order[i]].cut_rows]
    _mark_cut(axes, [(x[i], y[i]) for i in cut])
    mark_best(axes, best.point.setting[column.name] * factor, best.power)
    missing = [coordinates[axis] * factor for coordinates in slice_.missing]
    if missing:
        at_bottom: dict[str, Any] = {"transform": axes.get_xaxis_transform(), "clip_on": False}
        axes.plot(missing, [0.0] * len(missing), "x", color=DARK, ms=4.5, mew=1.2, **at_bottom)
    if len({*x, *missing}) == 1:
        margin = 0.5 * abs(x[0]) or 1000.0
        axes.set_xlim(x[0] - margin, x[0] + margin)
    axes.set_ylim(_widen(*axes.get_ylim()))
    axes.set_xlabel(labels.axis_label(column), fontsize=8)
    axes.grid(alpha=0.3)


def _draw_dots(axes: Axes, slice_: Slice, colour_scale: Scale) -> None:
    x, y = zip(*display_xy(slice_, slice_.xy), strict=True)
    style: dict[str, Any] = {"s": 30.0, "edgecolors": DARK, "linewidths": 0.6, "clip_on": False}
    axes.scatter(x, y, c=slice_.values, cmap=colour_scale.colours, norm=colour_scale.norm, **style)


def _draw_sparse(axes: Axes, slice_: Slice, colour_scale: Scale) -> None:
    """Draw the points as coloured dots within the planned range: too few for a surface."""
    _draw_dots(axes, slice_, colour_scale)
    planned = np.array(display_xy(slice_, [*slice_.xy, *slice_.missing]))
    margin = 0.05 * np.ptp(planned, axis=0)
    low, high = planned.min(axis=0) - margin, planned.max(axis=0) + margin
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    style: dict[str, Any] = {"transform": axes.transAxes, "ha": "center", "fontsize": 7.5}
    axes.text(0.5, 0.5, "too few points for a surface", color=DARK, va="center", **style)


def draw_scatter(axes: Axes, slice_: Slice, colour_scale: Scale) -> None:
    """Draw every point as a coloured dot, whatever its other columns, without interpolation."""
    style_axes(axes)
    _draw_dots(axes, slice_, colour_scale)
    _mark_cut(axes, _cut_places(slice_))
    if slice_.best is not None:
        best_setting = slice_.best.point.setting
        _mark_optimum(axes, slice_, slice_.best)
        set_point = ", ".join(
            labels.format_setting(c, best_setting[c.name]) for c in (slice_.y, slice_.x)
        )
        set_caption(
            axes,
            f"{slice_.best.caption} at {set_point}\n"
            f"all {len(slice_.points)} points, other columns differ: not interpolated",
        )
    axes.set_ylabel(labels.axis_label(slice_.y), fontsize=8)
    axes.margins(0.05)
    set_ticks(axes)


def display_xy(slice_: Slice, xy: Sequence[XY]) -> list[XY]:
    """Return coordinates in the displayed units of the axes."""
    factor_x, factor_y = labels.display_factor(slice_.x), labels.display_factor(slice_.y)
    return [(x * factor_x, y * factor_y) for x, y in xy]


def _cut_places(slice_: Slice) -> list[XY]:
    cut = [xy for xy, point in zip(slice_.xy, slice_.points, strict=True) if point.cut_rows]
    return display_xy(slice_, cut)


def format_caption(
    slice_: Slice, panel_width: float, *, compact: bool = False, sliced: bool = False
) -> str:
    """Return the caption of a panel: power and set point of the best point, and remarks.

    ``panel_width`` is in inches. ``compact`` leaves out the set point, which a table gives.
    ``sliced`` adds the values of the sliced columns, for panels without a heading.
    """
    best = slice_.best
    if best is None:
        return ""
    text = best.caption
    if not compact:
        axes = (slice_.y, slice_.x)
        gains = (f"{c.label} {_format_coordinate(c, best.point.setting[c.name])}" for c in axes)
        text += f" at {', '.join(gains)}"
        text += f" ({best.caveat})" if best.caveat and not best.flat else ""
    lines = [text, "; ".join(slice_remarks(slice_))]
    if sliced and slice_.sliced:
        lines.insert(1, f"sliced at {labels.format_settings(slice_.columns, slice_.sliced)}")
    width = round(panel_width * CAPTION_LETTERS)
    return "\n".join(part for line in lines for part in textwrap.wrap(line, width))


def _format_coordinate(column: Column, value: float) -> str:
    """Return a coordinate as text; gains without the unit, which the axis gives."""
    is_gain = column.role in (X, Y)
    return (labels.format_number if is_gain else labels.format_quantity)(column, value)


def draw_panel(
    axes: Axes, slice_: Slice, colour_scale: Scale | None, caption: str, *, few_ticks: bool = False
) -> PanelContent:
    """Draw a slice with its best point and caption; return the kind of plot.

    ``few_ticks`` is for narrow panels.
    """
    style_axes(axes)
    if slice_.best is None or colour_scale is None:
        axes.set_axis_off()
        axes.text(0.5, 0.5, "no data", transform=axes.transAxes, ha="center", color=DARK)
        return "nothing"
    sparse = is_too_sparse(slice_)
    content: PanelContent = "surface" if sparse or spans_surface(slice_.xy) else "line"
    if content == "surface":
        if sparse:
            _draw_sparse(axes, slice_, colour_scale)
        else:
            draw_surface(axes, display_xy(slice_, slice_.xy), slice_.values, colour_scale)
        if slice_.missing and not sparse:
            x, y = zip(*display_xy(slice_, slice_.missing), strict=True)
            (crosses,) = axes.plot(x, y, "x", color=DARK, ms=4.5, mew=1.2, clip_on=False)
            crosses.set_path_effects([withStroke(linewidth=3.0, foreground="white")])
        _mark_cut(axes, _cut_places(slice_))
        _mark_optimum(axes, slice_, slice_.best)
        subplot = axes.get_subplotspec()
        if subplot is None or subplot.is_last_row():
            axes.set_xlabel(labels.axis_label(slice_.x), fontsize=8)
        if subplot is None or subplot.is_first_col():
            axes.set_ylabel(labels.axis_label(slice_.y), fontsize=8)
    else:
        _draw_line(axes, slice_, slice_.best)
    set_ticks(axes, few_ticks=few_ticks)
    set_caption(axes, caption)
    return content


def draw_overlay(
    axes: Axes, slice_: Slice, points: Sequence[Point], colour_scale: Scale, content: PanelContent
) -> None:
    """Draw the points of another table as squares, on a surface in the colours of its scale."""
    if not points or content == "nothing":
        return
    xy = [(p.setting[slice_.x.name], p.setting[slice_.y.name]) for p in points]
    power = [p.power[slice_.station.name] for p in points]
    style: dict[str, Any] = {"clip_on": False, "zorder": 6}  # above the star of the best point
    if content == "surface":
        x, y = zip(*display_xy(slice_, xy), strict=True)
        style |= {"s": 42.0, "marker": "s", "edgecolors": ACCENT, "linewidths": 1.1}
        axes.scatter(x, y, c=power, cmap=colour_scale.colours, norm=colour_scale.norm, **style)
        return
    axis = line_axis(slice_)
    positions = [display_xy(slice_, [coordinates])[0][axis] for coordinates in xy]
    errors = np.nan_to_num([p.shown_error(slice_.station.name) for p in points])
    axes.errorbar(
        positions, power, yerr=errors, fmt="s", ms=8, mfc="none", color=ACCENT, capsize=2, **style
    )
    bounds = np.array([power - errors, power + errors])
    low, high = axes.get_ylim()  # of the panel's own points
    lowest = np.min(bounds, where=np.isfinite(bounds), initial=low)
    highest = np.max(bounds, where=np.isfinite(bounds), initial=high)
    margin = 0.05 * (highest - lowest)
    axes.set_ylim(lowest - margin * (lowest < low), highest + margin * (highest > high))


def set_ticks(axes: Axes, *, few_ticks: bool = False) -> None:
    """Set ticks at round numbers on both axes, few enough not to overlap."""
    most = 3 if few_ticks or for_paper() else 5
    axes.xaxis.set_major_locator(MaxNLocator(most, steps=_STEPS))
    axes.yaxis.set_major_locator(MaxNLocator(5, steps=_STEPS))


def share_power_axis(panels: list[Axes], label: str, *, label_each: bool) -> None:
    """Give line plots of one power the same scale; label the first or each of them."""
    limits = np.array([axes.get_ylim() for axes in panels])
    margin = 0.04 * (limits.max() - limits.min())
    for axes in panels:
        axes.set_ylim(limits.min() - margin, limits.max() + margin)
        axes.set_ylabel(label if label_each or axes is panels[0] else "", fontsize=8)


def add_colour_bar(
    figure: FigureBase, panels: list[Axes], colour_scale: Scale, label: str, **options: Any
) -> None:
    """Add the colour bar of a scale next to the panels that use it."""
    options = {"fraction": 0.04, "pad": 0.02} | options
    bar = figure.colorbar(
        ScalarMappable(colour_scale.norm, colour_scale.colours), ax=panels, **options
    )
    bar.set_label(label, fontsize=8)
    bar.ax.tick_params(labelsize=7)
    bar.outline.set_visible(False)


def count_lines(captions: Sequence[str]) -> int:
    """Return the number of lines of the longest caption."""
    return max(text.count("\n") for text in captions) + 1


def add_heading(axes: Axes, text: str, lines: int, *, compact: bool = False) -> None:
    """Add a heading above a panel whose caption has ``lines`` lines; wrapped for papers."""
    if for_paper():
        text = "\n".join(part for line in text.split("\n") for part in textwrap.wrap(line, 20))
    axes.annotate(
        text,
        (0.5, 1.0),
        xycoords="axes fraction",
        xytext=(0, 4 if for_paper() else 8 + 11 * lines),
        textcoords="offset points",
        ha="center",
        fontsize=7.5 if compact else 9,
        fontweight="bold",
        color=DARK,
    )
