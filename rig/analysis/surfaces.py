"""Power surfaces of a run: over its axes by panel, and sliced over any two columns.

Panels of one station share one colour scale. A slice has every other column at the
value where that station absorbs most, so each station has its own slice; the heading gives the
values. If the axes do not vary, the two columns with most values replace them. A matrix too
scattered for slices is drawn as single points without interpolation.
"""

import json
import textwrap
from pathlib import Path
from typing import Any, NamedTuple

import xarray
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase

from rig import stations
from rig.analysis import labels, panel
from rig.analysis.labels import panel_title
from rig.analysis.law_differences import law_groups
from rig.analysis.points import (
    Matrix,
    Point,
    Setting,
    error_note,
    gain_matrix,
    levels,
    varied_columns,
)
from rig.analysis.slices import (
    Slice,
    is_too_sparse,
    law_axes,
    panels,
    points_over,
    project_matrix,
    slice_matrix,
)
from rig.presentation import picture
from rig.presentation.picture import DARK
from rig.row_contents import MATCH, Column, X, Y, main_columns

NO_POINTS = Matrix((), ())
_HEADING_LETTERS = 40  # per line of a panel's heading
_MIN_WIDTH = 6.6  # in, so that title and stamp fit


class View(NamedTuple):
    """The axes of the panels of a picture."""

    x: Column
    y: Column
    by_panel: bool  # one column of panels for each value of the panel column


def default_view(matrix: Matrix) -> View:
    """Return the run's axes by panel if both vary or no other column does.

    For any other matrix return the two columns with most values.
    """
    varied, axes = varied_columns(matrix), law_axes(matrix)
    has_axes = (axes[0].role, axes[1].role) == (X, Y)
    gains = [column for column in varied if column in axes]
    only_gains = (gains and all(c in gains or c == matrix.panel for c in varied)) or not varied
    if has_axes and (len(gains) == 2 or only_gains):
        return View(*axes, True)
    ranked = sorted(varied, key=lambda column: -len(levels(matrix, column.name)))
    others = (axes[1], *matrix.columns) if has_axes else (*axes, *matrix.columns)
    x, y, *_ = (*ranked, *(column for column in others if column not in ranked))
    return View(x, y, not ranked)


class PanelGroup(NamedTuple):
    """The columns of panels of one law; those of a campaign of one law are one group."""

    law: str  # empty without a choice
    matrix: Matrix
    view: View
    fixed: list[Setting]  # of each column


def _panel_groups(matrix: Matrix) -> list[PanelGroup]:
    """Return the columns of panels, law by law: each law has its own axes."""
    groups = []
    for law, choice, own in law_groups(matrix):
        if own.points:
            view = default_view(own)
            fixed = [each | choice for each in _fixed_settings(own, view)]
            groups.append(PanelGroup(law, own, view, fixed))
    return groups


def panel_columns(table: xarray.Dataset) -> int:
    """Return the number of panel columns of `draw_surfaces`; 0 without a measured point."""
    matrix = gain_matrix(table)
    if not matrix.points:
        return 0
    if is_scattered(matrix):
        return 1
    return sum(len(group.fixed) for group in _panel_groups(matrix))


def _fixed_settings(matrix: Matrix, view: View) -> list[Setting]:
    """Return the set point of each column of panels."""
    return [each.fixed for each in panels(matrix)] if view.by_panel else [{}]


def is_scattered(matrix: Matrix) -> bool:
    """Return whether the slices of a matrix of many columns contain too few points to be drawn."""
    largest = max(
        (
            len(slice_matrix(own.matrix, station.name, own.view.x, own.view.y, fixed).points)
            for own in _panel_groups(matrix)
            for fixed in own.fixed
            for station in matrix.stations[-1:]
        ),
        default=0,
    )
    return largest < 3 <= len(matrix.points) and len(varied_columns(matrix)) > 3


def has_surface(matrix: Matrix) -> bool:
    """Return whether any panel of a matrix has points enough for a surface, or need not have."""
    view = default_view(matrix)
    return is_scattered(matrix) or any(
        not is_too_sparse(slice_matrix(matrix, station.name, view.x, view.y, fixed))
        for fixed in _fixed_settings(matrix, view)
        for station in stations.shown(matrix.stations)
    )


def draw_surfaces(
    figure: FigureBase,
    table: xarray.Dataset,
    width: float,
    *,
    compact: bool = False,
    overlay: Matrix = NO_POINTS,
) -> None:
    """Draw the grid of surfaces into a figure or subfigure that is ``width`` inches wide.

    ``compact`` is for narrow panels next to a table of the best points. The points of ``overlay``
    are drawn on top.
    """
    matrix = gain_matrix(table)
    panel.add_cut_legend(figure, matrix.cut_note)
    if not matrix.points:
        figure.text(0.5, 0.5, "no complete row: no surface to draw", ha="center", color=DARK)
        return
    if is_scattered(matrix):
        _draw_scattered(figure, matrix, default_view(matrix))
        return
    groups = _panel_groups(matrix)
    slices = [
        [
            slice_matrix(group.matrix, station.name, group.view.x, group.view.y, fixed)
            for group in groups
            for fixed in group.fixed
        ]
        for station in stations.shown(matrix.stations)
    ]
    headings = [heading for group in groups for heading in _headings(group)]
    shape = len(slices), len(headings)
    grid: Any = figure.subplots(*shape, squeeze=False)
    panel_width = (width - 1.0) / len(headings) - 0.4
    for i, of_station in enumerate(slices):
        captions = [
            panel.format_caption(each, panel_width, compact=compact, sliced=True)
            for each in of_station
        ]
        _draw_station(figure, grid[i].tolist(), of_station, captions, overlay, few_ticks=compact)
        if i == 0 and any(headings):
            for axes, title in zip(grid[i], headings, strict=True):
                panel.add_heading(axes, title, panel.count_lines(captions), compact=compact)
    for axes, slice_ in zip(grid[0], slices[0], strict=True):
        panel.mark_match(axes, slice_, json.loads(table.attrs.get(MATCH, "{}")))
    if picture.for_paper() and shape[1] > 1 and len(groups) == 1:
        for axes in grid[:, 1:].flat:  # rows have the same vertical axis
            axes.tick_params(labelleft=False)
            axes.set_ylabel("")
    figure.align_ylabels(grid)


def _headings(group: PanelGroup) -> list[str]:
    """Return the heading of each column of panels: the law and the value of the panel column."""
    matrix, titles = group.matrix, [""]
    panel_column = matrix.panel
    if group.view.by_panel:
        titles = [each.title for each in panels(matrix)]
    elif group.law and panel_column is not None and len(levels(matrix, panel_column.name)) == 1:
        titles = [panel_title(panel_column, matrix.points[0])]  # as in the columns of other laws
    law = f"law {group.law}" if group.law else ""
    return ["\n".join(filter(None, (law, title))) for title in titles]


def _draw_scattered(figure: FigureBase, matrix: Matrix, view: View) -> None:
    """Draw all points of a scattered matrix, one panel for each station."""
    drawn = stations.shown(matrix.stations)
    grid: Any = figure.subplots(len(drawn), 1, squeeze=False)
    for axes, station in zip(grid[:, 0], drawn, strict=True):
        slice_ = project_matrix(matrix, station.name, view.x, view.y)
        if slice_.points:
            colour_scale = panel.power_scale(slice_.values)
            panel.draw_scatter(axes, slice_, colour_scale)
            panel.add_colour_bar(figure, [axes], colour_scale, f"{station.short_label}, W")
    grid[-1, 0].set_xlabel(labels.axis_label(view.x), fontsize=8)


def points_in_slice(matrix: Matrix, slice_: Slice) -> list[Point]:
    """Return the points of another table that lie in a slice."""
    fixed = slice_.fixed | slice_.sliced
    return points_over(matrix, slice_.station.name, (slice_.x, slice_.y), fixed)


def _draw_station(
    figure: FigureBase,
    row: list[Axes],
    slices: list[Slice],
    captions: list[str],
    overlay: Matrix,
    *,
    few_ticks: bool,
) -> None:
    """Draw the panels of one station with a common scale and a caption each."""
    values = [value for slice_ in slices for value in slice_.values]
    values += [
        p.power[slice_.station.name] for slice_ in slices for p in points_in_slice(overlay, slice_)
    ]
    colour_scale = panel.power_scale(values) if values else None
    label = f"{slices[0].station.short_label}, W"
    axes_by_content: dict[str, list[Axes]] = {"surface": [], "line": [], "nothing": []}
    drawn: list[Slice] = []
    for axes, slice_, caption in zip(row, slices, captions, strict=True):
        content = panel.draw_panel(axes, slice_, colour_scale, caption, few_ticks=few_ticks)
        axes_by_content[content].append(axes)
        if content == "surface" and slice_.y != slices[max(0, len(drawn) - 1)].y:
            axes.set_ylabel(labels.axis_label(slice_.y), fontsize=8)  # the axes of the next law
        drawn.append(slice_)
        if colour_scale is not None:
            panel.draw_overlay(
                axes, slice_, points_in_slice(overlay, slice_), colour_scale, content
            )
    if axes_by_content["line"]:
        panel.share_power_axis(
            axes_by_content["line"], label, label_each=bool(axes_by_content["surface"])
        )
    if axes_by_content["surface"] and colour_scale is not None:
        panel.add_colour_bar(figure, row, colour_scale, label)


def write_surfaces(
    table: xarray.Dataset, path: Path, overlay: Matrix = NO_POINTS, subtitle: str = ""
) -> Path:
    """Write the power surfaces of a run as one picture, or a note if there is none to draw.

    The points of ``overlay`` are those of another table, drawn on top; ``subtitle`` describes them.
    """
    matrix = gain_matrix(table)
    sliced = not is_scattered(matrix) and any(map(_is_sliced, _panel_groups(matrix)))
    slice_note = "other columns at the optimum of each panel" if sliced else ""
    subtitle = "; ".join(filter(None, (subtitle, slice_note)))
    note = picture.sign_note(error_note(matrix.points))
    width = max(3.6 * max(1, panel_columns(table)) + 1.4, _MIN_WIDTH)
    title = f"Power surfaces: {picture.campaign_name(table.attrs)}"
    figure, body = picture.framed_figure(width, 9.0, title, table.attrs, note, subtitle)
    draw_surfaces(body, table, width, overlay=overlay)
    return picture.save(figure, path)


def _is_sliced(group: PanelGroup) -> bool:
    """Return whether more columns vary than the panels show."""
    matrix, view = group.matrix, group.view
    shown = {view.x, view.y, matrix.panel if view.by_panel else None}
    return bool({*varied_columns(matrix)} - shown)


def can_be_sliced(matrix: Matrix) -> bool:
    """Return whether the measured main columns vary and slices contain enough points.

    The surfaces of a single panel are the slices already.
    """
    measured = matrix._replace(planned=tuple(point.setting for point in matrix.points))
    main = main_columns(matrix.columns)
    return len(main) == 3 and {*main} <= {*varied_columns(measured)} and not is_scattered(matrix)


def write_sliced(
    table: xarray.Dataset,
    path: Path,
    axes: tuple[Column, Column] | None = None,
    fixed: Setting | None = None,
    names: tuple[str, ...] = (),
) -> Path:
    """Write one panel for each station over two columns, sliced where that station absorbs most.

    ``axes`` are x and y; default are those of the run. ``fixed`` fixes other columns at values of
    the campaign instead. ``names`` are stations by id or label; default are those shown in every
    picture. Raises ValueError for a value that is not in the campaign, and if both axes are the
    same column.
    """
    matrix = gain_matrix(table)
    x, y = axes or law_axes(matrix)
    if x == y:
        raise ValueError(f"{x.label} cannot be both axes of a surface")
    drawn = dict.fromkeys(stations.find(matrix.stations, name) for name in names)
    drawn = drawn or dict.fromkeys(stations.shown(matrix.stations))
    slices = [slice_matrix(matrix, station.name, x, y, fixed) for station in drawn]
    title = f"Power over {x.label} and {y.label}: {picture.campaign_name(table.attrs)}"
    width = max(4.1 * len(slices) + 0.5, _MIN_WIDTH)
    slice_note = "other columns at the optimum of each station"
    caption = picture.sign_note(error_note(matrix.points))
    height = 3.9 if not picture.for_paper() else 3.2 * -(-len(slices) // picture.paper_columns())
    figure, body = picture.framed_figure(
        width, height, title, table.attrs, caption, "" if fixed else slice_note
    )
    columns = min(len(slices), picture.paper_columns() or len(slices))
    rows = -(-len(slices) // columns)
    grid: Any = body.subplots(rows, columns, squeeze=False)
    panel.add_cut_legend(body, matrix.cut_note)
    for spare in grid.flat[len(slices) :]:
        spare.set_axis_off()
    panel_width = width / len(slices) - 1.0
    for plot, slice_ in zip(grid.flat, slices, strict=False):
        colour_scale = panel.power_scale(slice_.values) if slice_.values else None
        name = slice_.station.short_label
        caption = panel.format_caption(slice_, panel_width)
        content = panel.draw_panel(plot, slice_, colour_scale, caption)
        if content == "surface" and colour_scale is not None:
            panel.add_colour_bar(body, [plot], colour_scale, f"{name}, W", fraction=0.05)
        elif content == "line":
            panel.share_power_axis([plot], f"{name}, W", label_each=True)
        plot.set_ylabel(
            labels.axis_label(y) if content == "surface" else plot.get_ylabel(), fontsize=8
        )
        panel.add_heading(plot, slice_heading(slice_), panel.count_lines([caption]))
        if slice_.station == stations.shown(matrix.stations)[0]:  # that of the body
            panel.mark_match(plot, slice_, json.loads(table.attrs.get(MATCH, "{}")))
    return picture.save(figure, path)


def slice_heading(slice_: Slice) -> str:
    """Return the heading of a sliced panel: the station and the values of the other columns."""
    lines = [slice_.station.short_label]
    if slice_.sliced:
        lines += textwrap.wrap(
            f"sliced at {labels.format_settings(slice_.columns, slice_.sliced)}", _HEADING_LETTERS
        )
    if slice_.fixed:
        at = labels.format_settings(slice_.columns, slice_.fixed)
        lines += textwrap.wrap(f"at {at}", _HEADING_LETTERS)
    return "\n".join(lines)
