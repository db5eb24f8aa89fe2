"""Pictures of a sweep: surfaces over gains where it absorbs most, power over its parameters.

Measured points of a run of the same matrix are drawn on top: on surfaces as squares in the colours
of the same scale, on lines at the value that the campaign's own files have.
"""

import itertools
import json
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from rig.analysis import panel, phrases, picture
from rig.analysis.mesh import XY
from rig.analysis.picture import ACCENT, DARK, MUTED
from rig.analysis.points import Matrix, gain_matrix
from rig.analysis.rows import COMPLETE, POWERS, row_table
from rig.analysis.surfaces import KINDS, NO_POINTS, write_surfaces
from rig.config import ranges
from rig.config.problems import format_number

_MANY = 40  # lines of one panel that can be told apart at all


class Measured(NamedTuple):
    """The rows of a run."""

    points: Matrix
    words: str  # what the picture says of them


NOTHING_MEASURED = Measured(NO_POINTS, "")


def write(table: xarray.Dataset, folder: Path, run: Path | None = None) -> list[Path]:
    """All pictures that a sweep is good for; ``run`` is drawn on top.

    Raises as `rig.analysis.rows.row_table` does, and ValueError for a run that shares no point.
    """
    best = at_best(table)
    if best is None:
        return []
    if run is not None:  # what was measured had the values of the campaign's files
        best |= _at_base(table)
    rows = _rows(table, best)
    measured = _measured(run, rows) if run is not None else NOTHING_MEASURED
    said = "; ".join(filter(None, (_where(table, best), measured.words)))
    written = [write_surfaces(rows, folder / "surfaces.png", measured.points, said)]
    swept = [name for name in _overs(table) if _is_number(table, name)]
    if swept:
        written.append(_write_lines(table, best, swept, folder / "parameters.png", measured))
    measures = [name for name in swept if not _is_seed(name)]
    for x, y in itertools.combinations(measures, 2):
        written.append(_write_map(table, best, x, y, folder / f"map_{x}_{y}.png"))
    return written


def at_best(table: xarray.Dataset) -> dict[str, int] | None:
    """Indices of the parameters' values with the most power at the last station; None if none ran.

    That is the electrical DC power, what a device is built for.
    """
    found = _complete(table, "dc")
    if found is None:
        return None
    place: Any = found.argmin(...)
    return {name: int(place[name]) for name in _overs(table)}


def _at_base(table: xarray.Dataset) -> dict[str, int]:
    """Indices of the values nearest to those of the campaign's own files, where they are known."""
    found = {}
    for name in _overs(table):
        base = _base(table, name)
        if base is not None and _is_number(table, name):
            found[name] = int(np.abs(table[name].values - base).argmin())
    return found


def _overs(table: xarray.Dataset) -> list[str]:
    return [str(name) for name in table["state"].dims if name != "row"]


def _is_number(table: xarray.Dataset, name: str) -> bool:
    return table[name].dtype.kind in "if" and table.sizes[name] > 1


def _is_seed(name: str) -> bool:
    """A seed is no quantity: nothing lies between two of them."""
    return name.rpartition(".")[2] == "seed"


def _complete(table: xarray.Dataset, kind: str) -> xarray.DataArray | None:
    """Power of the complete rows, W; None where there is none."""
    if f"power_{kind}" not in table:
        return None
    power = table[f"power_{kind}"].where(table["state"] == COMPLETE)
    return power if bool(np.isfinite(power).any()) else None


def _rows(table: xarray.Dataset, at: dict[str, int]) -> xarray.Dataset:
    """The rows at one value of every parameter, as the row table of a run."""
    found = table.isel(at)
    for kind in POWERS:
        if f"power_{kind}" in found:
            found[f"power_{kind}_se"] = found.get(
                f"power_{kind}_se", found[f"power_{kind}"] * np.nan
            )
    return found


def _where(table: xarray.Dataset, at: dict[str, int]) -> str:
    """Which values the parameters have, in words; empty for a sweep of none."""
    return ", ".join(_setting(table, name, i) for name, i in at.items())


def _setting(table: xarray.Dataset, name: str, index: int) -> str:
    value = (
        table[name].values[index].item() if _is_number(table, name) else table[name].values[index]
    )
    shown = format_number(value) if isinstance(value, float) else str(value)
    return f"{name} {shown} {table[name].attrs.get('units', '')}".rstrip()


def _measured(run: Path, rows: xarray.Dataset) -> Measured:
    found = row_table(run)
    points, ours = gain_matrix(found), {_key(p.setting): p for p in gain_matrix(rows).points}
    pairs = [(p, ours[_key(p.setting)]) for p in points.points if _key(p.setting) in ours]
    if not pairs:
        raise ValueError(f"{run}: no complete row of it has the gains of a row of this sweep")
    off = []
    for kind in KINDS:
        less = [one.power[kind] - other.power[kind] for one, other in pairs]
        if np.isfinite(less).all():
            text = f"{phrases.format_signed(float(np.mean(less)), 1)} ± {float(np.std(less)):.1f} W"
            off.append(
                f"{phrases.STATION_ABBREVIATIONS[kind]} {text}".replace(" ", "\N{NO-BREAK SPACE}")
            )
    mode = found.attrs.get("mode", "")
    said = f"squares: {mode} {found.attrs.get('run', run.name)}, less simulated: {', '.join(off)}"
    return Measured(points, said)


def _key(setting: dict[str, float]) -> tuple[float, ...]:
    """The gains of a row: what every matrix has."""
    return tuple(setting.get(name, 0.0) for name in ("spring_rate", "kp", "ki", "km"))


def _base(table: xarray.Dataset, name: str) -> float | None:
    """The value of a parameter in the campaign's own files; None where they give none."""
    config: Any = json.loads(table.attrs["config"])
    head, *rest = name.split(".")
    inside = config[head] if head in ("rig", "plant", "limits") else config["campaign"].get(head)
    for part in rest:
        inside = inside.get(part) if isinstance(inside, dict) else None
    return float(inside) if isinstance(inside, int | float) else None


def _write_lines(
    table: xarray.Dataset, at: dict[str, int], swept: list[str], path: Path, measured: Measured
) -> Path:
    """One column of panels a parameter, one line a row, the others at their best."""
    width, title = max(6.6, 3.6 * len(swept) + 0.6), f"Power over parameters: {_name(table)}"
    beneath = "; ".join(filter(None, ("one line a row, numbered from 0", measured.words)))
    figure, body = picture.framed_figure(width, 8.2, title, table.attrs, subtitle=beneath)
    panels: Any = body.subplots(len(KINDS), len(swept), squeeze=False, sharey="row", sharex="col")
    for i, kind in enumerate(KINDS):
        power = _complete(table, kind)
        for j, name in enumerate(swept):
            axes: Axes = panels[i][j]
            picture.style_axes(axes)
            axes.grid(alpha=0.3)
            others = {key: index for key, index in at.items() if key != name}
            if power is not None:
                _lines(axes, table, power.isel(others).transpose(name, "row"), name)
                _squares(axes, _base(table, name), kind, measured)
            if j == 0:
                axes.set_ylabel(f"{phrases.STATION_ABBREVIATIONS[kind]}, W", fontsize=8)
            if i == 0:
                held = ", ".join(_setting(table, key, index) for key, index in others.items())
                axes.set_title(f"at {held}" if held else "", fontsize=7.5, color=ACCENT, pad=4)
            if i == len(KINDS) - 1:
                axes.set_xlabel(_axis(table, name), fontsize=8)
            if _is_seed(name):
                axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    return picture.save(figure, path)


def _lines(axes: Axes, table: xarray.Dataset, power: xarray.DataArray, name: str) -> None:
    """Every row thin, the one that absorbs most of all thick and named."""
    x, values = table[name].values, power.values
    order, join = np.argsort(x), "" if _is_seed(name) else "-"
    lowest = np.nanmin(np.where(np.isfinite(values), values, np.inf), axis=0)
    best = int(np.argmin(lowest))
    thinned = np.argsort(lowest)[:_MANY]
    for row in thinned:
        axes.plot(x[order], values[order, row], join or ".", color=MUTED, lw=0.6, ms=3, alpha=0.7)
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


def _squares(axes: Axes, base: float | None, kind: str, measured: Measured) -> None:
    """What was measured, at the value that the campaign's files have."""
    if base is None:
        return
    power = [p.power[kind] for p in measured.points.points if np.isfinite(p.power[kind])]
    axes.plot([base] * len(power), power, "s", ms=4.5, mfc="none", mec=ACCENT, zorder=4)


def _write_map(table: xarray.Dataset, at: dict[str, int], x: str, y: str, path: Path) -> Path:
    """Power of each pair of values with the gains that absorb most there, one panel a station."""
    others = {key: index for key, index in at.items() if key not in (x, y)}
    held = ", ".join(_setting(table, key, index) for key, index in others.items())
    beneath = "; ".join(filter(None, ("at the best row of each point", held)))
    title = f"Best power over {x} and {y}: {_name(table)}"
    figure, body = picture.framed_figure(12.8, 3.9, title, table.attrs, subtitle=beneath)
    panels: Any = body.subplots(1, len(KINDS), squeeze=False)
    for axes, kind in zip(panels[0], KINDS, strict=True):
        power = _complete(table, kind)
        picture.style_axes(axes)
        axes.set_xlabel(_axis(table, x), fontsize=8)
        axes.set_ylabel(_axis(table, y), fontsize=8)
        if power is None:
            continue
        best = power.isel(others).min("row").transpose(x, y)
        pairs = [
            ((float(a), float(b)), float(best.values[i, j]))
            for i, a in enumerate(table[x].values)
            for j, b in enumerate(table[y].values)
            if np.isfinite(best.values[i, j])
        ]
        places: list[XY] = [place for place, _ in pairs]
        values = [value for _, value in pairs]
        on = panel.power_scale(values)
        panel.draw_surface(axes, places, values, on)
        lowest = int(np.argmin(values))
        panel.mark_best(axes, *places[lowest])
        axes.set_title(phrases.format_power(values[lowest]), fontsize=7.5, color=ACCENT, pad=4)
        panel.add_colour_bar(
            body, [axes], on, f"{phrases.STATION_ABBREVIATIONS[kind]}, W", fraction=0.05
        )
        panel.set_ticks(axes)
    return picture.save(figure, path)


def _axis(table: xarray.Dataset, name: str) -> str:
    """A parameter's key, and its unit where the key does not say it."""
    unit = table[name].attrs.get("units", "")
    told = ranges.unit_of_key(name.rpartition(".")[2])
    return f"{name}, {unit}" if unit and not told else name


def _name(table: xarray.Dataset) -> str:
    return picture.campaign_name(table.attrs)
