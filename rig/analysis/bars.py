"""Bars by row, as MASK4 report (Sandia), Fig. 4-13: power above, what was set below.

Too many drive parameters vary for surfaces to show them; here every row is a bar in each of the
stacked panels: DC power, AC power, then one panel a drive parameter that varies, then whatever
else does, so that nothing that differs between two bars is hidden.
"""

from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray
from matplotlib.axes import Axes

from rig.analysis import labels, phrases, picture
from rig.analysis.picture import INK, MARK, SOFT
from rig.analysis.points import Matrix, row_settings, varied
from rig.analysis.rows import COMPLETE
from rig.config.columns import DRIVE_COLUMNS, Column

Sort = Literal["run", "power"]

_KINDS = ("dc", "ac")
_ABSORBED, _CONSUMED, _SET = "#1d6fa5", "#d9a441", "#8fa3b0"
_POWER, _SETTING = 1.75, 0.85  # in, height of a panel
_LEAST, _MOST = 8.0, 24.0  # in, width of the picture
_FEW = 5  # values of a column that each get a tick
_APART = 0.16  # of the panel, between two ticks
_LABELS = 55  # row numbers that are readable beside each other, not turned


def varies_drive(matrix: Matrix) -> bool:
    """Whether a drive parameter takes more than one value."""
    names = {column.name for column in DRIVE_COLUMNS}
    return any(column.name in names for column in varied(matrix))


def shown_columns(matrix: Matrix) -> list[Column]:
    """The columns that get a panel: drive parameters first."""
    names = {column.name for column in DRIVE_COLUMNS}
    found = varied(matrix)
    return [c for c in found if c.name in names] + [c for c in found if c.name not in names]


def order(table: xarray.Dataset, sort: Sort) -> list[int]:
    """Positions of the complete rows in the table: as run, or by DC power, most absorbed first."""
    here = np.flatnonzero(table["state"].values == COMPLETE).tolist()
    if sort == "run":
        return list(here)
    power = table["power_dc"].values
    return sorted(here, key=lambda i: float(np.nan_to_num(power[i], nan=np.inf)))


def write_bars(table: xarray.Dataset, path: Path, sort: Sort = "run") -> Path:
    """One bar a complete row with its standard error; the row that gives most DC power is marked.

    Raises ValueError where no row is complete.
    """
    places = order(table, sort) if "state" in table else []
    if not places:
        raise ValueError("no complete row: nothing to draw bars of")
    settings = row_settings(table)
    columns = shown_columns(Matrix((), tuple(settings[i] for i in places)))
    heights = [_POWER] * len(_KINDS) + [_SETTING] * len(columns)
    width = min(_MOST, max(_LEAST, 1.6 + 0.17 * len(places)))
    title = f"Power and settings by row: {picture.campaign(table.attrs)}"
    beneath = "rows as run" if sort == "run" else "rows by DC power, most absorbed first"
    if modulation := table.attrs.get("modulation"):
        beneath += f"; modulation {modulation}"
    said = "negative is absorbed; whiskers are ± standard error"
    if (table["periods"].values[places] >= 2).any():
        said += " by scatter of wave periods"
    figure, body = picture.framed(width, sum(heights) + 0.4, title, table.attrs, said, beneath)
    panels: Any = body.subplots(
        len(heights), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights}
    )
    stack: list[Axes] = panels[:, 0].tolist()
    x = np.arange(len(places))
    for axes, kind in zip(stack, _KINDS, strict=False):
        _power(axes, table, places, kind)
    for axes, column in zip(stack[len(_KINDS) :], columns, strict=True):
        values = [settings[i].get(column.name, float("nan")) for i in places]
        _set(axes, column, np.array(values) * labels.factor(column))
    _mark_best(stack, table, places)
    turned = 90 if len(places) > _LABELS else 0
    stack[-1].set_xticks(x, [str(table["row"].values[i]) for i in places], rotation=turned)
    stack[-1].set_xlim(-0.8, len(places) - 0.2)
    stack[-1].set_xlabel("row", fontsize=8)
    for axes in stack:
        picture.quiet(axes)
        axes.grid(axis="y", alpha=0.3)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    body.align_ylabels(stack)
    return picture.save(figure, path)


def _power(axes: Axes, table: xarray.Dataset, places: list[int], kind: str) -> None:
    power = table[f"power_{kind}"].values[places]
    errors = table[f"power_{kind}_se"].values[places]
    colours = [_CONSUMED if value > 0.0 else _ABSORBED for value in power]
    axes.bar(np.arange(len(places)), power, width=0.8, color=colours)
    known = np.flatnonzero(np.isfinite(errors))
    style: dict[str, Any] = {"fmt": "none", "ecolor": INK, "elinewidth": 0.9, "capsize": 2.0}
    axes.errorbar(known, power[known], yerr=errors[known], **style)
    axes.axhline(0.0, color=INK, lw=0.8)
    axes.set_ylabel(f"{phrases.STATION_ABBREVIATIONS[kind]}, W", fontsize=8)


def _set(axes: Axes, column: Column, values: Any) -> None:
    axes.bar(np.arange(len(values)), values, width=0.8, color=_SET)
    levels = np.unique(values[np.isfinite(values)])
    reach = max(abs(levels).max(), 1e-12)
    if len(levels) <= _FEW and (np.diff(levels) > _APART * reach).all():
        clear = (abs(levels) > _APART * reach).all()
        axes.set_yticks(np.append(levels, 0.0) if clear else levels)
    else:
        axes.locator_params(axis="y", nbins=4)
    if levels.min() >= 0.0:
        axes.set_ylim(0.0, 1.12 * reach)
    parts = filter(None, (column.label.replace(" ", "\n"), labels.unit(column)))
    axes.set_ylabel(",\n".join(parts), fontsize=7.5)


def _mark_best(stack: list[Axes], table: xarray.Dataset, places: list[int]) -> None:
    """A band through all panels at the row with most DC power, its value above it."""
    power = table["power_dc"].values[places]
    if not np.isfinite(power).any():
        return
    best = int(np.nanargmin(power))
    for axes in stack:
        bar = axes.patches[best]
        bar.set_edgecolor(MARK)
        bar.set_linewidth(1.6)
        axes.axvspan(best - 0.5, best + 0.5, color=MARK, alpha=0.13, lw=0, zorder=0)
    row = places[best]
    value = phrases.watts(float(power[best]), float(table["power_dc_se"].values[row]))
    middle = 0.5 * len(places)
    side: dict[str, Any] = {"ha": "left" if best < middle else "right", "va": "bottom"}
    stack[0].annotate(
        f"best: row {table['row'].values[row]}, {value}",
        (best, 1.0),
        xycoords=("data", "axes fraction"),
        xytext=(0, 3),
        textcoords="offset points",
        fontsize=8,
        color=MARK,
        **side,
    )
    waiting = int((table["state"].values != COMPLETE).sum())
    if waiting:
        left: dict[str, Any] = {"ha": "right" if best < middle else "left", "va": "bottom"}
        x = 1.0 if best < middle else 0.0
        rows, are = ("row", "is") if waiting == 1 else ("rows", "are")
        text = f"{waiting} {rows} without a whole window {are} left out"
        stack[0].text(x, 1.02, text, transform=stack[0].transAxes, fontsize=8, color=SOFT, **left)
