"""Figures of a sweep of sessions: every result over each parameter, with its 95 % interval."""

import itertools
import math
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from rig.analysis.rows import COMPLETE
from rig.presentation import picture
from rig.presentation.phrases import unit_text
from rig.presentation.picture import ACCENT, MUTED
from rig.sweeps.pictures import base_value, is_seed, parameter_label
from rig.sweeps.task import UNCERTAINTY, result_names

_COLUMNS = 3  # of panels
_PANEL = (3.7, 2.15)  # in, width and height
_MAX_NAMED = 10  # lines with a legend
_MAX_REASONS = 3
_MIN_SPAN = 2e-3  # of an axis of results, as a share of them: smaller differences look small
_COLOURS = colormaps["viridis"]

Place = dict[str, int]


def write_pictures(table: xarray.Dataset, folder: Path) -> list[Path]:
    """Write a figure for each parameter with several values; return their paths.

    Only complete cases are drawn. Without any there is no figure.
    """
    complete = table.where(table["state"] == COMPLETE)
    names = [name for name in result_names(table) if bool(np.isfinite(complete[name]).any())]
    swept = [str(key) for key in table["state"].dims if table.sizes[key] > 1]
    if not names:
        return []
    return [_write_results(table, complete, names, key, folder) for key in swept]


def _write_results(
    table: xarray.Dataset, complete: xarray.Dataset, names: list[str], key: str, folder: Path
) -> Path:
    """Plot all results over a parameter, a line for each combination of values of the others."""
    others = [str(each) for each in table["state"].dims if each != key]
    indices = itertools.product(*(range(table.sizes[each]) for each in others))
    places: list[Place] = [dict(zip(others, index, strict=True)) for index in indices]
    columns = min(_COLUMNS, len(names))
    rows = math.ceil(len(names) / columns)
    heights = [rows * _PANEL[1] + 0.3]
    if 1 < len(places) <= _MAX_NAMED:
        heights.append(0.1 + 0.2 * math.ceil(len(places) / 2))  # of the legend
    own = base_value(table, key)
    notes = [
        f"a colour for each value of {' and '.join(_name(table, each) for each in others)}"
        if others
        else "",
        "" if own is None else "dotted: the value in the files",
    ]
    figure, body = picture.framed_figure(
        max(2, columns) * _PANEL[0],
        sum(heights),
        f"{picture.campaign_name(table.attrs)}: results over {_name(table, key)}",
        table.attrs,
        "bars: 95 % intervals",
        "; ".join(filter(None, notes)),
        _left_out(table),
    )
    upper, *lower = body.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    panels: Any = upper.subplots(rows, columns, squeeze=False, sharex=True)
    x = _positions(table, key)
    for axes, name in itertools.zip_longest(panels.flat, names):
        if name is None:
            axes.set_axis_off()
            continue
        picture.style_axes(axes)
        axes.grid(alpha=0.25)
        axes.set_title(name.replace("_", " "), fontsize=8.5, loc="left", pad=4)
        axes.set_ylabel(_unit(table[name]), fontsize=8)
        for number, place in enumerate(places):
            share = number / max(1, len(places) - 1)  # later ones are drawn over larger markers
            style = {"color": _COLOURS(0.15 + 0.7 * share), "ms": 5.5 - 2.5 * share}
            _plot(axes, x, complete.isel(place), name, label=_text(table, place), **style)
        _widen(axes)
        if own is not None:
            axes.axvline(own, color=MUTED, lw=0.9, ls=":", zorder=0)
        for left_out in x[(table["state"] != COMPLETE).any(others).values]:
            axes.plot(left_out, 0.03, "x", color=ACCENT, ms=5, transform=axes.get_xaxis_transform())
        if table[key].dtype.kind == "i":
            axes.xaxis.set_major_locator(MaxNLocator(6, integer=True))
        elif table[key].dtype.kind == "f":
            axes.xaxis.set_major_locator(MaxNLocator(5))
        else:
            axes.set_xticks(x, [str(value) for value in table[key].values], fontsize=7)
    _label_columns(panels, len(names), ", ".join(filter(None, parameter_label(table, key))))
    for each in lower:
        handles, labels = panels[0, 0].get_legend_handles_labels()
        each.legend(handles, labels, loc="center", ncols=2, frameon=False, fontsize=8)
    return picture.save(figure, folder / f"results_{key}.png")


def _plot(axes: Axes, x: Any, results: xarray.Dataset, name: str, **style: Any) -> None:
    """Plot a result with its interval as far as it is known; seeds and texts are not joined."""
    order = np.argsort(x)
    uncertainty = np.nan_to_num(results[f"{name}{UNCERTAINTY}"].values.astype(float))
    (key,) = results[name].dims
    joined = results[key].dtype.kind in "if" and not is_seed(str(key))
    axes.errorbar(
        x[order], results[name].values[order], uncertainty[order],
        fmt="o-" if joined else "o", lw=1.2, elinewidth=0.9, capsize=2.5, **style,
    )  # fmt: skip


def _widen(axes: Axes) -> None:
    """Widen an axis whose range is so small that only rounding would fill it."""
    low, high = axes.get_ylim()
    middle = 0.5 * (low + high)
    least = 0.5 * _MIN_SPAN * abs(middle)
    if high - low < 2.0 * least:
        axes.set_ylim(middle - least, middle + least)
    axes.locator_params(axis="y", nbins=5)
    axes.ticklabel_format(axis="y", useOffset=False)


def _label_columns(panels: Any, count: int, label: str) -> None:
    """Label the lowest panel of each column, of ``count`` used ones, with its ticks."""
    rows, columns = panels.shape
    for column in range(columns):
        lowest = panels[rows - 1 if (rows - 1) * columns + column < count else rows - 2, column]
        lowest.set_xlabel(label, fontsize=8)
        lowest.tick_params(labelbottom=True)


def _positions(table: xarray.Dataset, key: str) -> Any:
    """Return the values of a parameter; for texts their numbers."""
    values = table[key].values
    return values.astype(float) if values.dtype.kind in "if" else np.arange(float(len(values)))


def _left_out(table: xarray.Dataset) -> str:
    """Return which cases are not drawn, and why; empty for a complete sweep."""
    state = table["state"].values
    left_out = state != COMPLETE
    if not left_out.any():
        return ""
    reasons = sorted(set(map(str, table["incomplete_reason"].values[left_out])))
    more = f"; and {len(reasons) - _MAX_REASONS} more" if len(reasons) > _MAX_REASONS else ""
    text = "; ".join(filter(None, reasons[:_MAX_REASONS]))
    return f"left out (×): {left_out.sum()} of {state.size} cases: {text}{more}"


def _text(table: xarray.Dataset, place: Place) -> str:
    """Return the values of parameters at a place."""
    texts = []
    for key, index in place.items():
        value = table[key].values[index]
        name, unit = parameter_label(table, key)
        number = isinstance(value, int | float | np.number)
        texts.append(f"{name} {value:g} {unit}".rstrip() if number else f"{name} {value}")
    return ", ".join(texts)


def _name(table: xarray.Dataset, key: str) -> str:
    return parameter_label(table, key)[0]


def _unit(values: xarray.DataArray) -> str:
    return unit_text(str(values.attrs.get("units", ""))).replace(" ", "·")
