"""Power surfaces over the gains, one panel a spring rate and kind of power.

Between measured points the surface is linear and passes through them; outside their hull nothing
is drawn, and a missing point is not a zero. More absorbed is darker; each kind of power has one
colour scale over all spring rates. Points on one line are no surface: they are drawn as a line,
power upward, and a row of lines alone has no colours to explain.
"""

from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure, FigureBase
from matplotlib.patheffects import AbstractPathEffect, withStroke
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import LinearTriInterpolator, TriAnalyzer, Triangulation

from rig.analysis import words
from rig.analysis.points import Optimum, Point, by_spring, optima, points

KINDS = ("mechanical_1", "ac", "dc")  # of the four stations, those shown as surfaces
COLOURS = colormaps["YlGnBu_r"]  # low, the most absorbed, is dark blue; safe for colour-blind eyes
MARK = "#d1495b"
ZERO = "#ffb703"
INK = "#22303c"
_STEPS = [1, 2, 2.5, 5, 10]
_SLIVER = 0.15  # least ratio of inner to outer circle; a grid cell's half has 0.41
_FLAT = 1e-9  # relative extent below which points lie on one line


def _scaled(group: list[Point]) -> Any:
    """Gains in units of their usual spacing: neither unit decides who is whose neighbour.

    Shape (n, 2), Ki first.
    """
    gains = np.array([(point.ki, point.kp) for point in group])
    steps = [np.diff(np.unique(column)) for column in gains.T]
    usual = [float(np.median(step)) if len(step) else 1.0 for step in steps]
    return (gains - gains.min(axis=0)) / np.array(usual)


def spans_surface(group: list[Point]) -> bool:
    """Whether the points are at least three and not on one line."""
    if len(group) < 3:
        return False
    centred = _scaled(group) - _scaled(group).mean(axis=0)
    spread = np.linalg.svd(centred, compute_uv=False)
    return bool(spread[1] > _FLAT * max(spread[0], 1.0))


def triangulation(group: list[Point]) -> Triangulation:
    """Neighbourhood of the measured points, x = Ki (N/m), y = Kp (N*s/m).

    Slivers along the border, which join points that are no neighbours (a grid that was left half
    done), are masked.
    """
    unit = _scaled(group)
    mesh = Triangulation(unit[:, 0], unit[:, 1])
    mask = TriAnalyzer(mesh).get_flat_tri_mask(_SLIVER, rescale=False)
    return Triangulation(
        [p.ki for p in group],
        [p.kp for p in group],
        mesh.triangles,
        None if np.all(mask) else mask,
    )


def interpolator(group: list[Point], kind: str) -> LinearTriInterpolator:
    """Power (W) as a function of (Ki, Kp), masked outside the measured points' hull."""
    return LinearTriInterpolator(triangulation(group), [p.power[kind] for p in group])


def _scale(found: list[Point], kind: str) -> Any:
    """Contour levels in W over all spring rates; None without a finite value."""
    values = [p.power[kind] for p in found if np.isfinite(p.power[kind])]
    if not values:
        return None
    low, high = min(values), max(values)
    if high - low < 1e-6:
        low, high = low - 0.5, high + 0.5
    return MaxNLocator(10).tick_values(low, high)


def _surface(axes: Axes, group: list[Point], kind: str, levels: Any, norm: Normalize) -> None:
    values = np.array([p.power[kind] for p in group])
    mesh = triangulation(group)
    fine = np.linspace(levels[0], levels[-1], 8 * (len(levels) - 1) + 1)
    axes.tricontourf(mesh, values, levels=fine, cmap=COLOURS, norm=norm)
    axes.tricontour(mesh, values, levels=levels, colors="white", linewidths=0.5, alpha=0.7)
    if values.min() < 0.0 < values.max():
        zero = axes.tricontour(mesh, values, levels=[0.0], colors=ZERO, linewidths=1.6)
        halo: list[AbstractPathEffect] = [withStroke(linewidth=2.6, foreground=INK)]
        zero.set_path_effects(halo)
        for label in axes.clabel(zero, fmt="0 W", fontsize=7):
            label.set_path_effects(halo)
    x, y = [p.ki for p in group], [p.kp for p in group]
    axes.plot(x, y, "o", mfc="white", mec=INK, mew=0.6, ms=3, clip_on=False)


def _line(axes: Axes, group: list[Point], kind: str, best: Optimum) -> None:
    """Points on one line, be it a single one: power against the gain that varies most."""
    along = int(np.ptp([p.kp for p in group]) > np.ptp([p.ki for p in group]))
    in_order = sorted(group, key=lambda p: (p.ki, p.kp)[along])
    x = [(p.ki, p.kp)[along] for p in in_order]
    y = [p.power[kind] for p in in_order]
    errors = np.nan_to_num([p.error[kind] for p in in_order])
    axes.errorbar(x, y, yerr=errors, fmt="o-", color=INK, ms=3.5, lw=1.0, capsize=2)
    _mark(axes, (best.point.ki, best.point.kp)[along], best.power)
    if len(group) == 1:
        axes.set_xlim(x[0] - 1000.0, x[0] + 1000.0)
    axes.set_xlabel(("Ki, N/m", "Kp, N·s/m")[along], fontsize=8)
    axes.grid(alpha=0.3)


def _one_scale(lines: list[Axes], label: str, beside_surfaces: bool) -> None:
    """The line plots of one kind of power on the same scale, labelled at the first or at each."""
    limits = np.array([axes.get_ylim() for axes in lines])
    for axes in lines:
        axes.set_ylim(limits.min(), limits.max())
        axes.set_ylabel(label if beside_surfaces or axes is lines[0] else "", fontsize=8)


def _mark(axes: Axes, x: float, y: float) -> None:
    axes.plot(x, y, "*", ms=13, mfc=MARK, mec="white", mew=0.9, clip_on=False, zorder=5)


def _caption(best: Optimum, compact: bool, note: str) -> str:
    value = words.watts(best.power, best.error)
    if compact:  # the gains stand in the table above
        return f"{value}; {note}" if note else value
    where = f"{value} at Kp {words.signed(best.point.kp)}, Ki {words.signed(best.point.ki)}"
    if note:
        return f"{where}; {note}"
    return f"{where} ({best.doubt})" if best.doubt else where


def _line_note(group: list[Point]) -> str:
    """What keeps the points from being a surface, where the axis does not show it."""
    if len(group) < 3:
        return "1 point only" if len(group) == 1 else "2 points only"
    one_gain = len({p.kp for p in group}) == 1 or len({p.ki for p in group}) == 1
    return "" if one_gain else "points on one line"


def _panel(
    axes: Axes,
    group: list[Point],
    best: Optimum | None,
    levels: Any,
    compact: bool,
) -> Literal["surface", "line", "nothing"]:
    axes.tick_params(labelsize=7, color="#8a949d")
    for side in axes.spines.values():
        side.set_color("#b8c0c7")
    if best is None:
        axes.set_axis_off()
        axes.text(0.5, 0.5, "no value", transform=axes.transAxes, ha="center", color=INK)
        return "nothing"
    kind = best.kind
    finite = [p for p in group if np.isfinite(p.power[kind])]
    surface = spans_surface(finite)
    if surface:
        _surface(axes, finite, kind, levels, Normalize(levels[0], levels[-1]))
        _mark(axes, best.point.ki, best.point.kp)
        axes.use_sticky_edges = False
        axes.margins(0.05)
        place = axes.get_subplotspec()
        if place is None or place.is_last_row():
            axes.set_xlabel("Ki, N/m", fontsize=8)
        if place is None or place.is_first_col():
            axes.set_ylabel("Kp, N·s/m", fontsize=8)
    else:
        _line(axes, finite, kind, best)
    axes.xaxis.set_major_locator(MaxNLocator(3 if compact else 5, steps=_STEPS))
    axes.yaxis.set_major_locator(MaxNLocator(5, steps=_STEPS))
    note = "" if surface else _line_note(finite)
    axes.set_title(_caption(best, compact, note), fontsize=7.5, color=MARK, pad=4)
    return "surface" if surface else "line"


def draw(figure: FigureBase, table: xarray.Dataset, compact: bool = False) -> None:
    """Put the grid of surfaces into a figure or a part of one; ``compact`` for narrow panels."""
    found = points(table)
    groups = by_spring(found)
    if not groups:
        figure.text(0.5, 0.5, "no complete row: no surface", ha="center", color=INK)
        return
    best = {(o.kind, o.point.spring_rate): o for o in optima(table)}
    panels: Any = figure.subplots(len(KINDS), len(groups), squeeze=False)
    for i, kind in enumerate(KINDS):
        levels, label = _scale(found, kind), f"{words.SHORT_NAMES[kind]}, W"
        drawn: dict[str, list[Axes]] = {"surface": [], "line": [], "nothing": []}
        for axes, (rate, group) in zip(panels[i], groups.items(), strict=True):
            drawn[_panel(axes, group, best.get((kind, rate)), levels, compact)].append(axes)
            if i == 0:
                _heading(axes, words.spring_words(rate, group[0].stator), compact)
        if drawn["line"]:
            _one_scale(drawn["line"], label, beside_surfaces=bool(drawn["surface"]))
        if drawn["surface"]:
            _colour_bar(figure, panels[i].tolist(), levels, label)


def _colour_bar(figure: FigureBase, beside: list[Axes], levels: Any, label: str) -> None:
    colours = ScalarMappable(Normalize(levels[0], levels[-1]), COLOURS)
    bar = figure.colorbar(colours, ax=beside, fraction=0.04, pad=0.02)
    bar.set_label(label, fontsize=8)
    bar.ax.tick_params(labelsize=7)
    bar.outline.set_visible(False)


def _heading(axes: Axes, text: str, compact: bool) -> None:
    """A column's title, above the caption of its first panel."""
    axes.annotate(
        text,
        (0.5, 1.0),
        xycoords="axes fraction",
        xytext=(0, 19),
        textcoords="offset points",
        ha="center",
        fontsize=7.5 if compact else 9,
        fontweight="bold",
        color=INK,
    )


def write_surfaces(table: xarray.Dataset, path: Path) -> Path:
    """The run's power surfaces as one picture; says so in it where there is nothing to show."""
    columns = max(1, len(by_spring(points(table))))
    figure = Figure(figsize=(3.6 * columns + 1.4, 9.2), layout="constrained")
    title: Any = figure.subfigures(2, 1, height_ratios=[0.55, 9.0])
    attributes = table.attrs
    title_text = f"Power surfaces: {attributes.get('campaign', 'campaign unknown')}"
    title[0].text(
        0.02,
        0.45,
        title_text,
        fontsize=min(13.0, 13.0 * 36 / len(title_text)),  # beside the stamp, however long
        fontweight="bold",
        color=INK,
        va="center",
    )
    title[0].text(
        0.98,
        0.62,
        words.rung_stamp(attributes.get("rung", "")),
        fontsize=9,
        fontweight="bold",
        color=MARK,
        ha="right",
        va="center",
    )
    title[0].text(
        0.98,
        0.18,
        f"run {attributes.get('run', '')}; negative is absorbed",
        fontsize=8,
        color=INK,
        ha="right",
        va="center",
    )
    draw(title[1], table)
    figure.savefig(path, dpi=150)
    return path
