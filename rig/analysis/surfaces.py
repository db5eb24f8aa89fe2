"""Power surfaces of a run: by spring rate over Kp and Ki, and sliced over any two columns.

By spring rate, each kind of power has one colour scale over all panels. A slice has every other
column at the value where that station absorbs most, so each station has its own; the title says
which. Where Kp and Ki are not what varies, the two columns with most values take their place. Of
a matrix so scattered that slices are next to empty, all points are shown and nothing between them.
"""

import textwrap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import FigureBase

from rig.analysis import labels, panel, phrases, picture
from rig.analysis.labels import BY_NAME
from rig.analysis.picture import INK
from rig.analysis.points import Matrix, Point, Setting, agrees, levels, matrix, scatter_of, varied
from rig.analysis.slices import KI, KP, Slice, by_spring, cut, projected
from rig.config.columns import Column

KINDS = ("mechanical_1", "ac", "dc")  # of the four stations, those shown where none is asked for
NO_OTHERS = Matrix((), ())
_HEADING = 40  # letters of a line of a panel's heading
_NARROWEST = 6.6  # in, so that title and stamp have room


class View(NamedTuple):
    """What the panels of a picture show."""

    x: Column
    y: Column
    by_spring: bool  # one column of panels a spring rate


def default_view(found: Matrix) -> View:
    """Kp over Ki by spring rate, if both vary or nothing else does.

    Of any other matrix the two columns that take most values.
    """
    names = [column.name for column in varied(found)]
    gains = {"kp", "ki"} & set(names)
    if len(gains) == 2 or (gains and set(names) <= {*gains, "spring_rate"}) or not names:
        return View(KI, KP, True)
    ranked = sorted(names, key=lambda name: -len(levels(found, name)))
    return View(BY_NAME[ranked[0]], BY_NAME[ranked[1]] if len(ranked) > 1 else KP, False)


def panels_across(table: xarray.Dataset) -> int:
    """Columns of panels that `draw` makes; 0 without a measured point."""
    found = matrix(table)
    if not found.points:
        return 0
    if scattered(found):
        return 1
    return len(by_spring(found)) if default_view(found).by_spring else 1


def scattered(found: Matrix) -> bool:
    """Whether slices hold too few points of a matrix of many columns to show anything."""
    view = default_view(found)
    held: list[Setting] = [{"spring_rate": r} for r in by_spring(found)] if view.by_spring else [{}]
    most = max((len(cut(found, "dc", view.x, view.y, each).points) for each in held), default=0)
    return most < 3 <= len(found.points) and len(varied(found)) > 3


def draw(
    figure: FigureBase,
    table: xarray.Dataset,
    width: float,
    *,
    compact: bool = False,
    others: Matrix = NO_OTHERS,
) -> None:
    """Put the grid of surfaces into a figure or a part of one, ``width`` in wide.

    ``compact`` for narrow panels beside a table of the best points; ``others`` are points to be
    drawn on top.
    """
    found = matrix(table)
    if not found.points:
        figure.text(0.5, 0.5, "no complete row: no surface", ha="center", color=INK)
        return
    view, rates = default_view(found), by_spring(found)
    if scattered(found):
        _dots(figure, found, view)
        return
    held: list[Setting] = [{"spring_rate": rate} for rate in rates] if view.by_spring else [{}]
    headings = [phrases.spring_text(rate, stator) for rate, stator in rates.items()]
    cuts = {kind: [cut(found, kind, view.x, view.y, each) for each in held] for kind in KINDS}
    panels: Any = figure.subplots(len(KINDS), len(held), squeeze=False)
    room = (width - 1.0) / len(held) - 0.4
    for i, kind in enumerate(KINDS):
        said = [panel.caption(each, room, compact=compact, sliced=True) for each in cuts[kind]]
        _station(figure, panels[i].tolist(), cuts[kind], said, others, few=compact)
        if i == 0 and view.by_spring:
            for axes, text in zip(panels[i], headings, strict=True):
                panel.above(axes, text, panel.lines_of(said), compact=compact)
    figure.align_ylabels(panels)


def _dots(figure: FigureBase, found: Matrix, view: View) -> None:
    """All points of a scattered matrix, one panel a kind of power."""
    panels: Any = figure.subplots(len(KINDS), 1, squeeze=False)
    for axes, kind in zip(panels[:, 0], KINDS, strict=True):
        of = projected(found, kind, view.x, view.y)
        if of.points:
            on = panel.scale(of.values)
            panel.scattered(axes, of, on)
            panel.colour_bar(figure, [axes], on, f"{phrases.STATION_ABBREVIATIONS[kind]}, W")
    panels[-1, 0].set_xlabel(labels.heading(view.x), fontsize=8)


def of_slice(others: Matrix, of: Slice) -> list[Point]:
    """The points of another table that lie in a slice."""
    fixed = of.held | of.sliced
    return [
        p
        for p in others.points
        if agrees(p.setting, fixed)
        and {of.x.name, of.y.name} <= p.setting.keys()
        and np.isfinite(p.power[of.kind])
    ]


def _station(
    figure: FigureBase,
    row: list[Axes],
    cuts: list[Slice],
    said: list[str],
    others: Matrix,
    *,
    few: bool,
) -> None:
    """The panels of one kind of power, with one scale and a caption each."""
    values = [value for each in cuts for value in each.values]
    values += [p.power[each.kind] for each in cuts for p in of_slice(others, each)]
    on = panel.scale(values) if values else None
    label = f"{phrases.STATION_ABBREVIATIONS[cuts[0].kind]}, W"
    drawn: dict[str, list[Axes]] = {"surface": [], "line": [], "nothing": []}
    for axes, each, text in zip(row, cuts, said, strict=True):
        became = panel.panel(axes, each, on, text, few=few)
        drawn[became].append(axes)
        if on is not None:
            panel.on_top(axes, each, of_slice(others, each), on, became)
    if drawn["line"]:
        panel.one_height(drawn["line"], label, each=bool(drawn["surface"]))
    if drawn["surface"] and on is not None:
        panel.colour_bar(figure, row, on, label)


def write_surfaces(
    table: xarray.Dataset, path: Path, others: Matrix = NO_OTHERS, beneath: str = ""
) -> Path:
    """The run's power surfaces as one picture; says so in it where there is nothing to show.

    ``others`` are points of another table, drawn on top; ``beneath`` says what they are.
    """
    found = matrix(table)
    view = default_view(found)
    shown = {view.x.name, view.y.name, *(("spring_rate",) if view.by_spring else ())}
    sliced = {column.name for column in varied(found)} - shown and not scattered(found)
    left_out = "left-out columns at each panel's own optimum" if sliced else ""
    beneath = "; ".join(filter(None, (beneath, left_out)))
    said = picture.absorbed(scatter_of(found.points))
    width = max(3.6 * max(1, panels_across(table)) + 1.4, _NARROWEST)
    title = f"Power surfaces: {picture.campaign(table.attrs)}"
    figure, body = picture.framed(width, 9.0, title, table.attrs, said, beneath)
    draw(body, table, width, others=others)
    return picture.save(figure, path)


def can_be_sliced(found: Matrix) -> bool:
    """Whether Kp, Ki and spring rate vary in what was measured, and slices hold enough points.

    At a single spring rate the surfaces by spring rate are the slices.
    """
    measured = found._replace(asked=tuple(point.setting for point in found.points))
    names = {column.name for column in varied(measured)}
    return names >= {"kp", "ki", "spring_rate"} and not scattered(found)


def write_sliced(
    table: xarray.Dataset,
    path: Path,
    x: Column = KI,
    y: Column = KP,
    held: Setting | None = None,
    kinds: tuple[str, ...] = KINDS,
) -> Path:
    """One panel a station over two columns, each sliced where that station absorbs most.

    ``held`` fixes left-out columns at values of the campaign instead. Raises ValueError for a
    value that is not in the campaign, and where both axes are one column.
    """
    if x == y:
        raise ValueError(f"{x.label} cannot be both axes of a surface")
    found = matrix(table)
    cuts = [cut(found, kind, x, y, held) for kind in kinds]
    title = f"Power over {x.label} and {y.label}: {picture.campaign(table.attrs)}"
    width = max(4.1 * len(kinds) + 0.5, _NARROWEST)
    others = "every other column at the optimum of the station"
    said = picture.absorbed(scatter_of(found.points))
    figure, body = picture.framed(width, 3.9, title, table.attrs, said, "" if held else others)
    panels: Any = body.subplots(1, len(kinds), squeeze=False)
    room = width / len(kinds) - 1.0
    for axes, each in zip(panels[0], cuts, strict=True):
        on = panel.scale(each.values) if each.values else None
        name = phrases.STATION_ABBREVIATIONS[each.kind]
        said = panel.caption(each, room)
        drawn = panel.panel(axes, each, on, said)
        if drawn == "surface" and on is not None:
            panel.colour_bar(body, [axes], on, f"{name}, W", fraction=0.05)
        elif drawn == "line":
            panel.one_height([axes], f"{name}, W", each=True)
        axes.set_ylabel(labels.heading(y) if drawn == "surface" else axes.get_ylabel(), fontsize=8)
        panel.above(axes, heading(each), panel.lines_of([said]))
    return picture.save(figure, path)


def heading(of: Slice) -> str:
    """A sliced panel's heading: the station and where its other columns stand."""
    lines = [phrases.STATION_ABBREVIATIONS[of.kind]]
    if of.sliced:
        lines += textwrap.wrap(f"sliced at {labels.settings(of.sliced)}", _HEADING)
    if of.held:
        lines += textwrap.wrap(f"{labels.settings(of.held)} held", _HEADING)
    return "\n".join(lines)
