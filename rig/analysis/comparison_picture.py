"""Picture of two compared runs: surfaces on one colour scale, and their difference.

The picture shows matched points only. Columns that are not an axis are fixed at the set point where
the station absorbs most in either run, equal for both, so that the subtracted points correspond.
Points that do not span a surface are drawn with error bars, over the only column that varies or in
the order of run A.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase

from rig.analysis import labels, panel
from rig.analysis.comparison import (
    Comparison,
    Pair,
    PowerDifference,
    format_difference,
    joint_setting,
    mean_difference,
    power_difference,
)
from rig.analysis.cut_rows import mark_meaning
from rig.analysis.points import Matrix, Point, Setting, agrees, varied_columns
from rig.analysis.slices import XY, Slice, slice_matrix, spans_surface
from rig.analysis.surfaces import View, default_view
from rig.presentation import picture
from rig.presentation.picture import ACCENT, DARK
from rig.row_contents import Column
from rig.stations import Station, shown

_DIFFERENCE_COLOURS = colormaps["PuOr_r"]  # purple: B absorbs more
_A, _B = "#0b6e99", "#d17a22"
_MAX_ROW_LABELS = 50  # rotated tick labels that fit side by side
_SIGNIFICANCE = 2.0  # standard errors
_WIDTH = 11.7  # in
_CAPTION_WIDTH = 3.3  # in
_MAX_SUBTITLE_SETTINGS = 2


class _MatchedRuns(NamedTuple):
    """Matched points of both runs, with one common set point for each pair."""

    a: Matrix
    b: Matrix
    pairs: tuple[Pair, ...]
    settings: tuple[Setting, ...]
    stations: tuple[Station, ...]  # drawn


def _matched_runs(comparison: Comparison) -> _MatchedRuns:
    pairs = comparison.matched.pairs
    settings = tuple(p.a.setting | joint_setting(comparison.matched, p) for p in pairs)

    def matrix_of(side: int) -> Matrix:
        points = tuple(p[side]._replace(setting=s) for p, s in zip(pairs, settings, strict=True))
        return Matrix(points, settings, comparison.matched.all_columns, comparison.stations)

    stations = shown(comparison.stations)
    return _MatchedRuns(matrix_of(0), matrix_of(1), pairs, settings, stations)


def write_comparison(comparison: Comparison, path: Path, fixed: Setting | None = None) -> Path:
    """Write the picture of a comparison.

    ``fixed`` (SI, by column name) fixes columns at other values than those of the best point.
    Raises ValueError if no point matches, or for a fixed value that no pair has.
    """
    runs = _matched_runs(comparison)
    if not runs.pairs:
        raise ValueError("no set point in common: nothing to draw")
    view = default_view(runs.a)._replace(by_panel=False)
    slices = [_slices(runs, station.name, view, fixed or {}) for station in runs.stations]
    # A run without a column that the other varies has no surface over it.
    has_surfaces = not comparison.matched.one_sided and all(
        spans_surface(pair[0].xy) for pair in slices if pair[0].points
    )
    a, b = comparison.a, comparison.b
    mode = a.mode if a.mode == b.mode else f"A {a.mode}, B {b.mode}"
    run_names = f"A {a.run}, B {b.run}"
    figure, body = picture.framed_figure(
        _WIDTH,
        9.6,
        f"A {a.campaign} against B {b.campaign}",
        {"mode": mode, "run": run_names},
        "",
        _subtitle(comparison),
        "; ".join(comparison.warnings),
    )
    if has_surfaces:
        _draw_surfaces(body, slices, runs)
    else:
        _draw_lines(body, runs, fixed or {}, (f"A {a.campaign}", f"B {b.campaign}"))
    return picture.save(figure, path)


def _subtitle(comparison: Comparison) -> str:
    """Return the common sea, and the rigs and control settings if they differ."""
    parts = [f"sea {comparison.a.sea}"] if comparison.same_sea else []
    if comparison.a.rig != comparison.b.rig:
        parts.append(f"A on {comparison.a.rig}, B on {comparison.b.rig}")
    control = [each for each in comparison.differences if each.group == "control"]
    parts += [f"{each.key}: A {each.a}, B {each.b}" for each in control[:_MAX_SUBTITLE_SETTINGS]]
    if len(control) > _MAX_SUBTITLE_SETTINGS:
        parts.append("and more")
    return "; ".join(parts)


def _slices(runs: _MatchedRuns, station: str, view: View, fixed: Setting) -> tuple[Slice, Slice]:
    """Return the same slice of both runs, through the best point of either."""
    free = {c.name for c in varied_columns(runs.a)} - {view.x.name, view.y.name}
    slices = [slice_matrix(side, station, view.x, view.y, fixed) for side in (runs.a, runs.b)]
    optima = [each.best for each in slices if each.best is not None]
    if not optima:
        return slices[0], slices[1]
    best_setting = min(optima, key=lambda optimum: optimum.power).point.setting
    at_best = {name: best_setting[name] for name in free if name in best_setting}
    common = slices[0].fixed | at_best
    slice_a, slice_b = (
        slice_matrix(side, station, view.x, view.y, common) for side in (runs.a, runs.b)
    )
    return slice_a, slice_b


def _draw_surfaces(body: FigureBase, slices: list[tuple[Slice, Slice]], runs: _MatchedRuns) -> None:
    if any(point.cut_rows for side in (runs.a, runs.b) for point in side.points):
        panel.add_cut_legend(body, mark_meaning("one station"))
    panels: Any = body.subplots(len(slices), 3, squeeze=False)
    for i, both in enumerate(slices):
        slice_a, slice_b = both
        row: list[Axes] = panels[i].tolist()
        captions = [panel.format_caption(slice_, _CAPTION_WIDTH) for slice_ in both]
        lines = panel.count_lines(captions)
        colour_scale = panel.power_scale([*slice_a.values, *slice_b.values])
        name = slice_a.station.short_label
        for axes, slice_, letter, caption in zip(row, both, "AB", captions, strict=False):
            panel.draw_panel(axes, slice_, colour_scale, caption)
            heading = f"{letter}: {name}"
            if slice_.fixed:
                heading += f"\nat {labels.format_settings(slice_.columns, slice_.fixed)}"
            panel.add_heading(axes, heading, lines)
        panel.add_colour_bar(body, row[:2], colour_scale, f"{name}, W", fraction=0.05)
        _draw_difference(body, row[2], slice_a, runs, lines)


def _draw_difference(
    body: FigureBase, axes: Axes, slice_: Slice, runs: _MatchedRuns, lines: int
) -> None:
    """Draw B less A over the slice; points with a significant difference are filled."""
    station = slice_.station.name
    drawn = [
        (setting, pair)
        for setting, pair in zip(runs.settings, runs.pairs, strict=True)
        if agrees(setting, slice_.fixed) and np.isfinite(power_difference(pair, station).watts)
    ]
    picture.style_axes(axes)
    coordinates: list[XY] = [(s[slice_.x.name], s[slice_.y.name]) for s, _ in drawn]
    differences = [power_difference(pair, station) for _, pair in drawn]
    if not spans_surface(coordinates):
        axes.set_axis_off()
        return
    watts = [each.watts for each in differences]
    colour_scale = panel.power_scale(watts, _DIFFERENCE_COLOURS, symmetric=True)
    xy = panel.display_xy(slice_, coordinates)
    panel.draw_surface(axes, xy, watts, colour_scale, zero_line=False)
    panel.set_ticks(axes)
    significant = [at for at, each in zip(xy, differences, strict=True) if _is_significant(each)]
    if significant:
        x, y = zip(*significant, strict=True)
        axes.plot(x, y, "o", color=DARK, ms=3.4, clip_on=False)
    is_last = slice_.station == runs.stations[-1]
    axes.set_xlabel(labels.axis_label(slice_.x) if is_last else "", fontsize=8)
    mean = format_difference(mean_difference(tuple(pair for _, pair in drawn), station))
    text = f"mean of these points {mean} W\nfilled: beyond {_SIGNIFICANCE:g} standard errors"
    panel.set_caption(axes, text)
    panel.add_heading(axes, "B − A (negative: B absorbs more)", max(lines, 2))
    panel.add_colour_bar(body, [axes], colour_scale, "B − A, W", fraction=0.08)


def _is_significant(difference: PowerDifference) -> bool:
    return abs(difference.watts) > _SIGNIFICANCE * difference.error  # an unknown error is NaN


def _draw_lines(
    body: FigureBase, runs: _MatchedRuns, fixed: Setting, names: tuple[str, str]
) -> None:
    """Draw both runs with error bars on the left and their difference on the right."""
    indices = [i for i, s in enumerate(runs.settings) if agrees(s, fixed)]
    if not indices:
        raise ValueError(f"no matched point at {labels.format_settings(runs.a.columns, fixed)}")
    varied = varied_columns(Matrix((), tuple(runs.settings[i] for i in indices), runs.a.columns))
    column = varied[0] if len(varied) == 1 else None
    if column is not None:
        indices.sort(key=lambda i: runs.settings[i][column.name])
    x = np.array([_position(runs, i, n, column) for n, i in enumerate(indices)])
    panels: Any = body.subplots(len(runs.stations), 2, squeeze=False, sharex=True)
    for i, station in enumerate(runs.stations):
        pair_axes, difference_axes = panels[i].tolist()
        style: dict[str, Any] = {"ms": 4.0, "lw": 1.0, "capsize": 2.5}
        line_style = "-" if column is not None else ""
        for name, matrix, colour, marker in zip(
            names, (runs.a, runs.b), (_A, _B), "os", strict=True
        ):
            points: list[Point] = [matrix.points[n] for n in indices]
            y = [p.power[station.name] for p in points]
            errors = np.nan_to_num([p.error[station.name] for p in points])
            pair_axes.errorbar(
                x, y, yerr=errors, fmt=f"{marker}{line_style}", color=colour, label=name, **style
            )
        differences = [power_difference(runs.pairs[n], station.name) for n in indices]
        errors = np.nan_to_num([each.error for each in differences])
        watts = [each.watts for each in differences]
        difference_axes.errorbar(x, watts, yerr=errors, fmt=f"D{line_style}", color=DARK, **style)
        difference_axes.axhline(0.0, color=ACCENT, lw=1.0)
        pair_axes.set_ylabel(f"{station.short_label}, W", fontsize=8)
        difference_axes.set_ylabel("B − A, W", fontsize=8)
        pairs = tuple(runs.pairs[n] for n in indices)
        mean = format_difference(mean_difference(pairs, station.name))
        difference_axes.set_title(
            f"mean {mean} W (negative: B absorbs more)", fontsize=8, color=ACCENT
        )
        if i == 0:
            legend_style: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (0.0, 0.98)}
            pair_axes.legend(fontsize=8, frameon=False, ncols=2, borderpad=0.1, **legend_style)
        for axes in (pair_axes, difference_axes):
            picture.style_axes(axes)
            axes.grid(alpha=0.3)
            if i == len(runs.stations) - 1:
                rows_text = "matched points, row of A | row of B"
                axes.set_xlabel(labels.axis_label(column) if column else rows_text, fontsize=8)
    if column is None:
        rows = [f"{runs.pairs[n].a.rows[0]}|{runs.pairs[n].b.rows[0]}" for n in indices]
        rotation = 90 if len(rows) > 12 else 0
        every = int(np.ceil(len(rows) / _MAX_ROW_LABELS))
        for axes in panels[-1]:
            axes.set_xticks(x[::every], rows[::every], rotation=rotation)


def _position(runs: _MatchedRuns, i: int, number: int, column: Column | None) -> float:
    if column is None:
        return float(number)
    return runs.settings[i][column.name] * labels.display_factor(column)
