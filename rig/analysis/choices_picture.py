"""The choices of an adaptive campaign as a picture: powers in order, expected loss, and places."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from rig.analysis import labels, panel
from rig.analysis.choices import ChosenRow
from rig.analysis.points import row_settings
from rig.analysis.rows import COMPLETE, columns_of, stations_of
from rig.presentation import picture
from rig.presentation.picture import ACCENT, DARK, FRAME, MUTED
from rig.realtime.sequence import NO_ROW
from rig.row_contents import LAW, PANEL, X, Y
from rig.stations import find

_WIDTH, _HEIGHT = 10.0, 5.2  # in
_MEASURED = "#1d6fa5"


def write_choices(
    choices: Sequence[ChosenRow],
    station_name: str,
    precision: float,
    table: xarray.Dataset,
    path: Path,
) -> Path:
    """Draw the choices of a run: ``station_name`` is that whose power counts.

    ``precision``: expected loss of the best row at which the campaign ends, W. Raises ValueError
    if no chosen row is complete.
    """
    rows, states = table["row"].values.tolist(), table["state"].values
    chosen = [each.row for each in choices if each.row != NO_ROW]
    order = [i for i in map(rows.index, chosen) if states[i] == COMPLETE]
    if not order:
        raise ValueError("no chosen row is complete")
    station = find(stations_of(table), station_name)
    power, errors = (table[f"power_{station.name}{end}"].values[order] for end in ("", "_se"))
    best = int(np.argmin(power))
    figure, body = picture.framed_figure(
        _WIDTH,
        _HEIGHT,
        f"Choice of rows: {picture.campaign_name(table.attrs)}",
        table.attrs,
        "negative is absorbed; whiskers are ± standard error",
        f"{len(order)} of {len(rows)} candidates measured; best: row {rows[order[best]]}",
    )
    grid: Any = body.subplot_mosaic([["power", "place"], ["regret", "place"]])
    _draw_powers(grid["power"], power, errors, best, station.short_label)
    _draw_regret(grid["regret"], choices, precision)
    _draw_places(grid["place"], table, order, best)
    for axes in grid.values():
        picture.style_axes(axes)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    return picture.save(figure, path)


def _draw_powers(axes: Axes, power: Any, errors: Any, best: int, label: str) -> None:
    x = np.arange(1, len(power) + 1)
    known = np.isfinite(errors)
    axes.errorbar(
        x[known], power[known], yerr=errors[known], fmt="none", ecolor=DARK, elinewidth=0.9,
        capsize=2.0,
    )  # fmt: skip
    axes.plot(x, power, "o", color=_MEASURED, ms=5)
    axes.plot(x[best], power[best], "o", color=ACCENT, ms=8, label="best")
    axes.step(
        x, np.minimum.accumulate(power), where="post", color=MUTED, lw=1.0, label="best so far"
    )
    axes.set_ylabel(f"{label}, W", fontsize=8)
    axes.legend(fontsize=7.5, frameon=False)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def _draw_regret(axes: Axes, choices: Sequence[ChosenRow], precision: float) -> None:
    known = [(i, each.regret) for i, each in enumerate(choices) if np.isfinite(each.regret)]
    if known:
        x, regret = np.array(known).T
        axes.semilogy(x, np.maximum(regret, 1e-3 * precision), "o-", color=_MEASURED, ms=4, lw=1.0)
    axes.axhline(precision, color=ACCENT, lw=1.0, ls="--")
    axes.annotate(
        f"precision {precision:g} W", (1.0, precision), xycoords=("axes fraction", "data"),
        xytext=(0, 3), textcoords="offset points", ha="right", fontsize=7.5, color=ACCENT,
    )  # fmt: skip
    axes.set_ylabel("expected loss\nof the best row, W", fontsize=8)
    axes.set_xlabel("measured rows", fontsize=8)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))


def _draw_places(axes: Axes, table: xarray.Dataset, order: list[int], best: int) -> None:
    """Draw the candidates over two columns, the measured ones with their place in the order."""
    settings = row_settings(table)
    varied = [
        column
        for column in columns_of(table)
        if len({each.get(column.name) for each in settings}) > 1
    ]
    ranked = sorted(varied, key=lambda column: _RANKS.get(column.role, len(_RANKS)))
    x, y = (ranked + ranked)[:2]
    panels = [column for column in ranked if column not in (x, y)]
    xs, ys = (
        np.array([each.get(column.name, np.nan) for each in settings])
        * labels.display_factor(column)
        for column in (x, y)
    )
    shift = np.zeros(len(settings))
    if panels:  # rows that differ in further columns only stand side by side
        levels = sorted({each.get(panels[0].name, 0.0) for each in settings})
        step = 0.25 * np.min(np.diff(np.unique(xs)), initial=np.ptp(xs) or 1.0)
        middle = 0.5 * (len(levels) - 1)
        shift = np.array(
            [step * (levels.index(each.get(panels[0].name, 0.0)) - middle) for each in settings]
        )
    axes.plot(xs + shift, ys, "o", mfc="none", mec=FRAME, ms=6, label="candidates")
    for number, i in enumerate(order, 1):
        colour = ACCENT if number == best + 1 else _MEASURED
        axes.plot(xs[i] + shift[i], ys[i], "o", color=colour, ms=12)
        axes.annotate(
            str(number), (xs[i] + shift[i], ys[i]), ha="center", va="center", fontsize=7,
            color="white",
        )  # fmt: skip
    axes.set_xlabel(labels.axis_label(x), fontsize=8)
    axes.set_ylabel(labels.axis_label(y), fontsize=8)
    panel.set_ticks(axes)
    if panels:
        texts = ", ".join(labels.format_quantity(panels[0], level) for level in levels)
        axes.set_title(f"{panels[0].label} from left to right: {texts}", fontsize=8, loc="left")


_RANKS = {X: 0, Y: 1, LAW: 2, PANEL: 3}
