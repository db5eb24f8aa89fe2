"""Figures of a sweep: power surfaces over the gains at the best parameters, power over parameters.

Measured points of a run of the same matrix can be drawn on top: squares with the same colour scale
on surfaces, markers at the parameter value of the campaign's own files on lines.
"""

import itertools
import json
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, Locator, MaxNLocator

from rig.analysis import panel
from rig.analysis.points import Matrix, gain_matrix
from rig.analysis.rows import COMPLETE, row_table, stations_of
from rig.analysis.slices import XY, spans_surface
from rig.analysis.surfaces import NO_POINTS, write_surfaces
from rig.config import ranges
from rig.config.problems import format_number
from rig.presentation import phrases, picture
from rig.presentation.picture import ACCENT, DARK, MUTED
from rig.row_contents import LAW, PANEL, Column, X, Y
from rig.stations import shown, station_names

_MAX_COLUMNS = 4  # of panels side by side
_MAX_TICKS = 6
_MIN_TICK_SPACING = 0.12  # of the range of the values, between two ticks
_LABEL_GAP = 0.05  # of the range of a panel's lines, between two labels
_MAX_LINES = 40  # of one panel; more cannot be distinguished


class MeasuredRun(NamedTuple):
    """The measured rows of a run."""

    points: Matrix
    caption: str  # text below the figure


NO_MEASUREMENT = MeasuredRun(NO_POINTS, "")


def write_pictures(table: xarray.Dataset, folder: Path, run: Path | None = None) -> list[Path]:
    """Write all figures that a sweep's parameters allow; return their paths.

    The rows of ``run`` are drawn on top. Raises the errors of `rig.analysis.rows.row_table`, and
    ValueError for a run that shares no point with the sweep.
    """
    best = best_indices(table)
    if best is None:
        return []
    if run is not None:  # the run had the values of the campaign's files
        best |= _base_indices(table)
    rows = _rows_at(table, best)
    measured = _compare_run(run, rows) if run is not None else NO_MEASUREMENT
    caption = "; ".join(filter(None, (_format_values(table, best), measured.caption)))
    written = [write_surfaces(rows, folder / "surfaces.png", measured.points, caption)]
    swept = [name for name in _parameter_names(table) if _is_number(table, name)]
    for number, names in enumerate(_groups(swept), 1):
        path = folder / f"parameters{f'_{number}' if number > 1 else ''}.png"
        written.append(_write_lines(table, best, names, path, measured))
    quantities = [name for name in swept if not is_seed(name)]
    for x, y in itertools.combinations(quantities, 2):
        written.append(_write_map(table, best, x, y, folder / f"map_{x}_{y}.png"))
    if len(quantities) > 2:
        x, y, by, *_ = sorted(quantities, key=lambda name: -table.sizes[name])
        written.append(_write_facets(table, best, (x, y, by), folder / "facets.png"))
    return written


def _groups(names: list[str]) -> list[list[str]]:
    """Return the names in groups that fit side by side."""
    return [names[i : i + _MAX_COLUMNS] for i in range(0, len(names), _MAX_COLUMNS)]


def best_indices(table: xarray.Dataset) -> dict[str, int] | None:
    """Return the indices of the parameters' values with the most absorbed power; None without rows.

    The power is that of the last station.
    """
    power = _complete(table, stations_of(table)[-1].name)
    if power is None:
        return None
    place: Any = power.argmin(...)
    return {name: int(place[name]) for name in _parameter_names(table)}


def _base_indices(table: xarray.Dataset) -> dict[str, int]:
    """Return the indices of the values nearest to those of the campaign's files, where known."""
    indices = {}
    for name in _parameter_names(table):
        base = base_value(table, name)
        if base is not None and _is_number(table, name):
            indices[name] = int(np.abs(table[name].values - base).argmin())
    return indices


def _parameter_names(table: xarray.Dataset) -> list[str]:
    return [str(name) for name in table["state"].dims if name != "row"]


def _is_number(table: xarray.Dataset, name: str) -> bool:
    return table[name].dtype.kind in "if" and table.sizes[name] > 1


def is_seed(name: str) -> bool:
    """Return whether a parameter is a seed, which must not be interpolated."""
    return name.rpartition(".")[2] == "seed"


def _complete(table: xarray.Dataset, station: str) -> xarray.DataArray | None:
    """Return the power of the complete rows, W; None without a complete row."""
    if f"power_{station}" not in table:
        return None
    power = table[f"power_{station}"].where(table["state"] == COMPLETE)
    return power if bool(np.isfinite(power).any()) else None


def _rows_at(table: xarray.Dataset, indices: dict[str, int]) -> xarray.Dataset:
    """Return the rows at one value of every parameter, in the format of a run's row table."""
    rows = table.isel(indices)
    for name in station_names(stations_of(table)):
        if f"power_{name}" in rows:
            rows[f"power_{name}_se"] = rows.get(f"power_{name}_se", rows[f"power_{name}"] * np.nan)
    return rows


def _format_values(table: xarray.Dataset, indices: dict[str, int]) -> str:
    """Return the values of the parameters as text; empty for a sweep without parameters."""
    return ", ".join(_format_value(table, name, i) for name, i in indices.items())


def _format_value(table: xarray.Dataset, name: str, index: int) -> str:
    value = table[name].values[index]
    text = format_number(float(value)) if isinstance(value, np.floating) else str(value)
    label, unit = parameter_label(table, name)
    return f"{label} {text} {unit}".rstrip()


def _compare_run(run: Path, rows: xarray.Dataset) -> MeasuredRun:
    run_rows = row_table(run)
    points = gain_matrix(run_rows)
    gains = [column for column in points.columns if column.role in (PANEL, X, Y, LAW)]
    simulated = {_gains_key(p.setting, gains): p for p in gain_matrix(rows).points}
    keyed = [(p, _gains_key(p.setting, gains)) for p in points.points]
    pairs = [(p, simulated[key]) for p, key in keyed if key in simulated]
    if not pairs:
        raise ValueError(f"{run}: no complete row has the gains of a row of this sweep")
    differences = []
    for station in shown(points.stations):
        errors = [one.power[station.name] - other.power[station.name] for one, other in pairs]
        if np.isfinite(errors).all():
            mean = phrases.format_signed(float(np.mean(errors)), 1)
            text = f"{station.short_label} {mean} ± {float(np.std(errors)):.1f} W"
            differences.append(text.replace(" ", "\N{NO-BREAK SPACE}"))
    mode = run_rows.attrs.get("mode", "")
    name = run_rows.attrs.get("run", run.name)
    caption = f"squares: {mode} {name} minus simulated: {', '.join(differences)}"
    return MeasuredRun(points, caption)


def _gains_key(setting: dict[str, float], columns: list[Column]) -> tuple[float, ...]:
    return tuple(setting.get(column.name, 0.0) for column in columns)


def base_value(table: xarray.Dataset, name: str) -> float | None:
    """Return the value of a parameter in the task's own files; None if they have none."""
    config: Any = json.loads(table.attrs["config"])
    head, *rest = name.split(".")
    own = config["campaign"] if "campaign" in config else config["session"]
    inside = config[head] if head in ("rig", "plant", "limits") else own.get(head)
    for part in rest:
        inside = inside.get(part) if isinstance(inside, dict) else None
    return float(inside) if isinstance(inside, int | float) else None


def _write_facets(
    table: xarray.Dataset, indices: dict[str, int], names: tuple[str, str, str], path: Path
) -> Path:
    """Plot the best power over two parameters for each value of a third, stations as rows."""
    x, y, by = names
    chosen = _spread(table.sizes[by], _MAX_COLUMNS)
    others = {key: index for key, index in indices.items() if key not in names}
    fixed = _format_values(table, others)
    beneath = "; ".join(filter(None, ("at the best row of each point", fixed)))
    title = f"Best power by {parameter_label(table, by)[0]}: {_campaign(table)}"
    stations = shown(stations_of(table))
    width, height = max(6.6, 3.1 * len(chosen) + 0.8), 2.3 * len(stations) + 0.4
    figure, body = picture.framed_figure(width, height, title, table.attrs, subtitle=beneath)
    panels: Any = body.subplots(len(stations), len(chosen), squeeze=False, sharex=True, sharey=True)
    for row, station in zip(panels, stations, strict=True):
        power = _complete(table, station.name)
        for axes, index in zip(row, chosen, strict=True):
            picture.style_axes(axes)
            if station is stations[0]:
                axes.set_title(_format_value(table, by, index), fontsize=8, color=DARK)
            if station is stations[-1]:
                axes.set_xlabel(_axis_label(table, x), fontsize=8)
        row[0].set_ylabel(_axis_label(table, y), fontsize=8)
        if power is None:
            continue
        best = power.isel(others).min("row").transpose(by, x, y)
        scale = panel.power_scale(best.values.ravel().tolist())
        for axes, index in zip(row, chosen, strict=True):
            _draw_best(axes, table, best.isel({by: index}), (x, y), scale)
        panel.add_colour_bar(body, row.tolist(), scale, f"{station.short_label}, W")
    return picture.save(figure, path)


def _spread(count: int, most: int) -> list[int]:
    """Return up to ``most`` indices of ``count`` values, evenly spread, with both ends."""
    return sorted({round(each) for each in np.linspace(0, count - 1, min(count, most))})


def _draw_best(
    axes: Axes, table: xarray.Dataset, best: xarray.DataArray, names: tuple[str, str], scale: Any
) -> None:
    """Draw the surface of the best power over two parameters, as far as it is known."""
    xs, ys = (table[name].values for name in names)
    finite = np.argwhere(np.isfinite(best.values))
    places: list[XY] = [(float(xs[i]), float(ys[j])) for i, j in finite]
    values = [float(best.values[i, j]) for i, j in finite]
    if not spans_surface(places):
        return
    panel.draw_surface(axes, places, values, scale)
    panel.mark_best(axes, *places[int(np.argmin(values))])
    panel.set_ticks(axes)


def _write_lines(
    table: xarray.Dataset,
    indices: dict[str, int],
    swept: list[str],
    path: Path,
    measured: MeasuredRun,
) -> Path:
    """Plot power over each parameter, one line per row, the other parameters at their best."""
    width, title = max(6.6, 3.2 * len(swept) + 0.6), f"Power over parameters: {_campaign(table)}"
    fixed = f"others at the best: {_format_values(table, indices)}" if len(indices) > 1 else ""
    lines = "one line per row, its number at the right end"
    beneath = "; ".join(filter(None, (lines, fixed, measured.caption)))
    figure, body = picture.framed_figure(width, 8.2, title, table.attrs, subtitle=beneath)
    stations = shown(stations_of(table))
    panels: Any = body.subplots(
        len(stations), len(swept), squeeze=False, sharey="row", sharex="col"
    )
    for i, station in enumerate(stations):
        power = _complete(table, station.name)
        for j, name in enumerate(swept):
            axes: Axes = panels[i][j]
            picture.style_axes(axes)
            axes.grid(alpha=0.3)
            others = {key: index for key, index in indices.items() if key != name}
            if power is not None:
                _plot_rows(axes, table, power.isel(others).transpose(name, "row"), name)
                _plot_measured(axes, base_value(table, name), station.name, measured)
            if j == 0:
                axes.set_ylabel(f"{station.short_label}, W", fontsize=8)
            if i == len(stations) - 1:
                axes.set_xlabel(_axis_label(table, name), fontsize=8)
            axes.xaxis.set_major_locator(_locator(table[name].values, is_seed(name)))
            axes.yaxis.set_major_locator(MaxNLocator(_MAX_TICKS))
    return picture.save(figure, path)


def _locator(values: Any, whole: bool) -> Locator:
    """Return ticks at the values of a parameter, or round ones where these lack room."""
    own = np.unique(values)
    if 1 < len(own) <= _MAX_TICKS and np.diff(own).min() > _MIN_TICK_SPACING * np.ptp(own):
        return FixedLocator(own.tolist())
    return MaxNLocator(_MAX_TICKS, integer=whole)


def _plot_rows(axes: Axes, table: xarray.Dataset, power: xarray.DataArray, name: str) -> None:
    """Plot every row as a thin line, and the row that absorbs most as a thick, labelled one."""
    x, values = table[name].values, power.values
    order, join = np.argsort(x), "" if is_seed(name) else "-"
    lowest = np.nanmin(np.where(np.isfinite(values), values, np.inf), axis=0)
    best = int(np.argmin(lowest))
    thinned = np.argsort(lowest)[:_MAX_LINES]
    for row in thinned:
        axes.plot(x[order], values[order, row], join or ".", color=MUTED, lw=0.6, ms=3, alpha=0.7)
    shown_values = values[:, thinned][np.isfinite(values[:, thinned])]
    gap = _LABEL_GAP * np.ptp(shown_values) if len(shown_values) else 0.0
    _label_rows(axes, x[order][-1], values[order[-1]], table["row"].values, thinned, gap)
    axes.plot(x[order], values[order, best], f"o{join}", color=DARK, lw=1.4, ms=3.5)
    end = int(np.nanargmin(np.where(np.isfinite(values[:, best]), values[:, best], np.inf)))
    panel.mark_best(axes, float(x[end]), float(values[end, best]))
    left = x[end] > 0.5 * (x.min() + x.max())
    axes.annotate(
        f"{phrases.format_power(float(values[end, best]))}, row {int(table['row'].values[best])}",
        (float(x[end]), float(values[end, best])),
        xytext=(-10 if left else 10, -4),
        textcoords="offset points",
        fontsize=7.5,
        color=ACCENT,
        ha="right" if left else "left",
        va="top",
    )
    axes.margins(0.08, 0.16)


def _label_rows(axes: Axes, x: float, values: Any, rows: Any, thinned: Any, gap: float) -> None:
    """Label the lines with their rows at the right end, at least ``gap`` (W) apart."""
    ends, below = [place for place in thinned if np.isfinite(values[place])], -np.inf
    for place in sorted(ends, key=lambda each: values[each]):
        if values[place] - below > gap:
            axes.annotate(
                str(rows[place]), (float(x), float(values[place])), xytext=(5, 0),
                textcoords="offset points", fontsize=6.5, color=MUTED, va="center",
            )  # fmt: skip
            below = values[place]


def _plot_measured(axes: Axes, base: float | None, station: str, measured: MeasuredRun) -> None:
    """Plot the measured power at the value of the campaign's files."""
    if base is None:
        return
    power = [x for p in measured.points.points if np.isfinite(x := p.power[station])]
    axes.plot([base] * len(power), power, "s", ms=4.5, mfc="none", mec=ACCENT, zorder=4)


def _write_map(table: xarray.Dataset, indices: dict[str, int], x: str, y: str, path: Path) -> Path:
    """Plot the best power at each pair of values, one panel per station."""
    others = {key: index for key, index in indices.items() if key not in (x, y)}
    fixed = _format_values(table, others)
    beneath = "; ".join(filter(None, ("at the best row of each point", fixed)))
    title = f"Best power over {' and '.join(parameter_label(table, each)[0] for each in (x, y))}"
    title += f": {_campaign(table)}"
    stations = shown(stations_of(table))
    columns = min(len(stations), picture.paper_columns() or 2)
    rows = -(-len(stations) // columns)
    size = 4.6 * columns, 3.2 * rows
    figure, body = picture.framed_figure(*size, title, table.attrs, subtitle=beneath)
    panels: Any = body.subplots(rows, columns, squeeze=False)
    for spare in panels.flat[len(stations) :]:
        spare.set_axis_off()
    for axes, station in zip(panels.flat, stations, strict=False):
        power = _complete(table, station.name)
        picture.style_axes(axes)
        axes.set_xlabel(_axis_label(table, x), fontsize=8)
        axes.set_ylabel(_axis_label(table, y), fontsize=8)
        if power is None:
            continue
        best = power.isel(others).min("row").transpose(x, y)
        scale = panel.power_scale(best.values.ravel().tolist())
        _draw_best(axes, table, best, (x, y), scale)
        panel.set_caption(axes, phrases.format_power(float(best.min())))
        panel.add_colour_bar(body, [axes], scale, f"{station.short_label}, W", fraction=0.05)
    return picture.save(figure, path)


def _axis_label(table: xarray.Dataset, name: str) -> str:
    return ", ".join(filter(None, parameter_label(table, name)))


def parameter_label(table: xarray.Dataset, name: str) -> tuple[str, str]:
    """Return the name of a parameter in words, and its unit; empty for a number without unit.

    The name is the key without the file that has it, the `value` of a plant's entry, and the unit.
    """
    *sections, key = name.removesuffix(".value").split(".")
    sections = [each for each in sections if each not in ("plant", "rig", "limits")]
    unit = ranges.unit_of_key(key)
    parts = key.split("_")
    if unit:  # the last parts of the key
        shortest = next(
            i for i in range(len(parts), 0, -1)
            if i == 1 or ranges.unit_of_key("_".join(["x", *parts[i:]])) == unit
        )  # fmt: skip
        parts = parts[:shortest]
    unit = unit or str(table[name].attrs.get("units", ""))
    label = " ".join([*sections, *parts]).replace("_", " ")
    return label, re.sub(r"(?<=[A-Za-z])2\b", "²", phrases.unit_text(unit).replace(" ", "·"))


def _campaign(table: xarray.Dataset) -> str:
    return picture.campaign_name(table.attrs)
