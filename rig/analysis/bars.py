"""Bars by row: power above, settings below, as MASK4 report (Sandia), Fig. 4-13.

Surfaces cannot show a matrix with many drive parameters. Here every row is a bar in each of the
stacked panels: DC power, AC power, one panel for each drive parameter that varies, then one for
each other column that varies, so that all differences between two bars are visible.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.patches import Patch

from rig.analysis import labels
from rig.analysis.cut_rows import cut_note, ended_as_worse
from rig.analysis.law_differences import is_choice, law_groups
from rig.analysis.points import PERCENT, Matrix, agrees, row_settings, varied_columns
from rig.analysis.rows import COMPLETE, columns_of, stations_of
from rig.presentation import phrases, picture
from rig.presentation.picture import ACCENT, DARK, MUTED
from rig.row_contents import DRIVE, Column
from rig.stations import Station, find, shown

Sort = Literal["run", "power"]

_ABSORBED_COLOUR, _CONSUMED_COLOUR, _SETTING_COLOUR = "#1d6fa5", "#d9a441", "#8fa3b0"
_CUT: dict[str, Any] = {"facecolor": "white", "hatch": "////", "linewidth": 0.8}
"""A hatched bar: the row ended because it could not be the best."""
_POWER_HEIGHT, _SETTING_HEIGHT = 1.75, 0.85  # in, heights of panels
_MIN_WIDTH, _MAX_WIDTH = 8.0, 24.0  # in, width of the picture
_MAX_LEVEL_TICKS = 5  # a column with at most this many values has a tick at each
_MIN_TICK_SPACING = 0.16  # share of the panel's height
_MAX_UPRIGHT_LABELS = 55  # row numbers that fit side by side without rotation


def varies_drive(matrix: Matrix) -> bool:
    """Return whether a drive parameter takes more than one value."""
    return any(column.role == DRIVE for column in varied_columns(matrix))


def row_order(table: xarray.Dataset, sort: Sort, station: Station) -> list[int]:
    """Return the table indices of complete rows in order of the run or of power at a station.

    By power, the row that absorbs most is first. Rows of one law stand together, in the order of
    the laws.
    """
    complete = np.flatnonzero(table["state"].values == COMPLETE).tolist()
    if sort == "power":
        power = table[f"power_{station.name}"].values
        complete.sort(key=lambda i: float(np.nan_to_num(power[i], nan=np.inf)))
    settings, choosing = row_settings(table), _choosing(table)
    return sorted(complete, key=lambda i: [settings[i].get(each.name, 0.0) for each in choosing])


def _choosing(table: xarray.Dataset) -> list[Column]:
    """Return the columns whose values are laws."""
    return [column for column in columns_of(table) if is_choice(column)]


def write_bars(
    table: xarray.Dataset, path: Path, sort: Sort = "run", names: Iterable[str] = ()
) -> Path:
    """Write a picture with a bar for each complete row; the best row is marked.

    The panels show the stations ``names``, by id or label; by default the last two of the pictures,
    the last one first. The first panel's station defines the best row and the order by power.

    Whiskers are standard errors, or 95 % intervals by a budget. Raises ValueError if no row is
    complete, and for unknown names.
    """
    named = dict.fromkeys(find(stations_of(table), name) for name in names)
    stations = tuple(named) or shown(stations_of(table))[:-3:-1]
    positions = row_order(table, sort, stations[0]) if "state" in table else []
    if not positions:
        raise ValueError("no complete row: no bars to draw")
    settings = row_settings(table)
    shown_rows = Matrix((), tuple(settings[i] for i in positions), columns_of(table))
    laws = law_groups(shown_rows)
    varied = (column for column in varied_columns(shown_rows) if not is_choice(column))
    columns = sorted(varied, key=lambda column: column.role != DRIVE)
    heights = [_POWER_HEIGHT] * len(stations) + [_SETTING_HEIGHT] * len(columns)
    width = min(_MAX_WIDTH, max(_MIN_WIDTH, 1.6 + 0.17 * len(positions)))
    title = f"Power and settings by row: {picture.campaign_name(table.attrs)}"
    subtitle = (
        "rows in order of the run" if sort == "run" else f"rows by {stations[0].short_label} power"
    )
    if modulation := table.attrs.get("modulation"):
        subtitle += f"; modulation {modulation}"
    has_budget = any(_error_column(table, each) != f"power_{each.name}_se" for each in stations)
    note = f"negative is absorbed; whiskers are ± {PERCENT if has_budget else 'standard error'}"
    if (table["periods"].values[positions] >= 2).any():
        note += " by scatter of wave periods"
    note += " and Type B" * has_budget
    figure, body = picture.framed_figure(
        width, sum(heights) + 0.4, title, table.attrs, note, subtitle
    )
    panels: Any = body.subplots(
        len(heights), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights}
    )
    axes_stack: list[Axes] = panels[:, 0].tolist()
    x = np.arange(len(positions))
    for axes, station in zip(axes_stack, stations, strict=False):
        _draw_power(axes, table, positions, station)
    for axes, column in zip(axes_stack[len(stations) :], columns, strict=True):
        values = [settings[i].get(column.name, float("nan")) for i in positions]
        _draw_setting(axes, column, np.array(values) * labels.display_factor(column))
    _mark_best(axes_stack, table, positions, stations[0])
    rotation = 90 if len(positions) > _MAX_UPRIGHT_LABELS else 0
    axes_stack[-1].set_xticks(
        x, [str(table["row"].values[i]) for i in positions], rotation=rotation
    )
    axes_stack[-1].set_xlim(-0.8, len(positions) - 0.2)
    axes_stack[-1].set_xlabel("row", fontsize=8)
    if note := cut_note(table):
        handle = Patch(label=note, edgecolor=_CONSUMED_COLOUR, **_CUT)
        body.legend(handles=[handle], loc="outside lower center", fontsize=8, frameon=False)
    if len(laws) > 1:
        members = [[agrees(settings[i], law.choice) for i in positions].count(True) for law in laws]
        _mark_laws(axes_stack, [law.name for law in laws], members)
    for axes in axes_stack:
        picture.style_axes(axes)
        axes.grid(axis="y", alpha=0.3)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    body.align_ylabels(axes_stack)
    return picture.save(figure, path)


def _error_column(table: xarray.Dataset, station: Station) -> str:
    """Return the column of the whiskers: the expanded uncertainty, or the standard error."""
    expanded = f"power_{station.name}_expanded"
    return expanded if expanded in table else f"power_{station.name}_se"


def _draw_power(axes: Axes, table: xarray.Dataset, positions: list[int], station: Station) -> None:
    power = table[f"power_{station.name}"].values[positions]
    errors = table[_error_column(table, station)].values[positions]
    colours = [_CONSUMED_COLOUR if value > 0.0 else _ABSORBED_COLOUR for value in power]
    bars = axes.bar(np.arange(len(positions)), power, width=0.8, color=colours)
    cut = ended_as_worse(table)
    for i, bar in zip(positions, bars, strict=True):
        if table["row"].values[i] in cut:
            bar.set(**_CUT, edgecolor=bar.get_facecolor())
    known_errors = np.flatnonzero(np.isfinite(errors))
    style: dict[str, Any] = {"fmt": "none", "ecolor": DARK, "elinewidth": 0.9, "capsize": 2.0}
    axes.errorbar(known_errors, power[known_errors], yerr=errors[known_errors], **style)
    axes.axhline(0.0, color=DARK, lw=0.8)
    axes.set_ylabel(f"{station.short_label}, W", fontsize=8)


def _draw_setting(axes: Axes, column: Column, values: Any) -> None:
    axes.bar(np.arange(len(values)), values, width=0.8, color=_SETTING_COLOUR)
    levels = np.unique(values[np.isfinite(values)])
    largest = max(abs(levels).max(), 1e-12)
    if len(levels) <= _MAX_LEVEL_TICKS and (np.diff(levels) > _MIN_TICK_SPACING * largest).all():
        zero_fits = (abs(levels) > _MIN_TICK_SPACING * largest).all()
        axes.set_yticks(np.append(levels, 0.0) if zero_fits else levels)
    else:
        axes.locator_params(axis="y", nbins=4)
    if levels.min() >= 0.0:
        axes.set_ylim(0.0, 1.12 * largest)
    parts = filter(None, (column.label.replace(" ", "\n"), labels.display_unit(column)))
    axes.set_ylabel(",\n".join(parts), fontsize=7.5)


def _mark_laws(stack: list[Axes], names: list[str], members: list[int]) -> None:
    """Draw a line through all panels between two laws, and the name of each below its rows."""
    start = 0
    for name, number in zip(names, members, strict=True):
        for axes in stack if start else ():
            axes.axvline(start - 0.5, color=DARK, lw=0.9, ls="--")
        stack[-1].annotate(
            f"law {name}",
            (start + 0.5 * (number - 1), 0.0),
            xycoords=("data", "axes fraction"),
            xytext=(0, -28),
            textcoords="offset points",
            ha="center",
            va="top",
            fontsize=8,
            fontweight="bold",
            color=DARK,
        )
        start += number


def _mark_best(
    stack: list[Axes], table: xarray.Dataset, positions: list[int], station: Station
) -> None:
    """Draw a band through all panels at the row with most power, with its value above."""
    power = table[f"power_{station.name}"].values[positions]
    if not np.isfinite(power).any():
        return
    best = int(np.nanargmin(power))
    for axes in stack:
        bar = axes.patches[best]
        bar.set_edgecolor(ACCENT)
        bar.set_linewidth(1.6)
        axes.axvspan(best - 0.5, best + 0.5, color=ACCENT, alpha=0.13, lw=0, zorder=0)
    row = positions[best]
    value = phrases.format_power(
        float(power[best]), float(table[_error_column(table, station)].values[row])
    )
    centre = 0.5 * len(positions)
    text_side: dict[str, Any] = {"ha": "left" if best < centre else "right", "va": "bottom"}
    stack[0].annotate(
        f"best: row {table['row'].values[row]}, {value}",
        (best, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(0, 3),
        textcoords="offset points",
        fontsize=8,
        color=ACCENT,
        **text_side,
    )
    incomplete = int((table["state"].values != COMPLETE).sum())
    if incomplete:
        text_style: dict[str, Any] = {"ha": "right" if best < centre else "left", "va": "bottom"}
        x = 1.0 if best < centre else 0.0
        noun, verb = ("row", "is") if incomplete == 1 else ("rows", "are")
        text = f"{incomplete} {noun} without a complete window {verb} left out"
        stack[0].text(
            x, 1.02, text, transform=stack[0].transAxes, fontsize=8, color=MUTED, **text_style
        )
