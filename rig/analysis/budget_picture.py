"""The uncertainty budget of a run as a picture: the contributions to that of the best powers."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes

from rig.analysis.rows import stations_of
from rig.analysis.uncertainty import BUDGET_ATTRIBUTE
from rig.presentation import phrases, picture
from rig.presentation.picture import DARK

_TYPE_B, _TYPE_A = "#1d6fa5", "#d9a441"
_WIDTH, _BAR_HEIGHT, _PANEL_MARGIN = 8.6, 0.24, 0.75  # in
SCATTER = "scatter of the periods"


def write_budget(table: xarray.Dataset, path: Path) -> Path:
    """Write a panel for each station: the contributions to the power of its best row.

    Raises ValueError for a table without a budget or without complete rows.
    """
    budget = json.loads(table.attrs.get(BUDGET_ATTRIBUTE, "{}"))
    stations = [each for each in stations_of(table) if each.name in budget.get("best", {})]
    if not stations:
        raise ValueError("no uncertainty budget, or no complete row")
    panels = [_contributions(table, budget, station.name) for station in stations]
    heights = [_PANEL_MARGIN + _BAR_HEIGHT * len(each) for each in panels]
    figure, body = picture.framed_figure(
        _WIDTH,
        sum(heights) + 0.3,
        f"Uncertainty of the best powers: {picture.campaign_name(table.attrs)}",
        table.attrs,
        "standard uncertainties; Type B from the budget, Type A from the scatter; GUM",
        f"budget {budget['name']}",
    )
    grid: Any = body.subplots(len(panels), 1, squeeze=False, gridspec_kw={"height_ratios": heights})
    for axes, station, parts in zip(grid[:, 0].tolist(), stations, panels, strict=True):
        row = table["row"].values.tolist().index(budget["best"][station.name]["row"])
        power = float(table[f"power_{station.name}"].values[row])
        half = float(table[f"power_{station.name}_expanded"].values[row])
        interval = "(95 %)" if np.isfinite(half) else "(interval unknown)"
        _draw(axes, parts)
        axes.set_title(
            f"{station.label}, row {table['row'].values[row]}: "
            f"{phrases.format_power(power, half)} {interval}",
            loc="left",
            fontsize=9,
        )
    grid[-1, 0].set_xlabel("standard uncertainty, W", fontsize=8)
    return picture.save(figure, path)


def _contributions(
    table: xarray.Dataset, budget: dict[str, Any], station: str
) -> list[tuple[str, float, str]]:
    """Return names, sizes (W) and colours of the contributions, the largest first."""
    best = budget["best"][station]
    pairs = zip(budget["sources"], best["contributions_w"], strict=True)
    largest = max(map(abs, best["contributions_w"]), default=0.0)
    # A source that does not act on the station, and one that cancels, are no contributions.
    found = [(name, abs(each), _TYPE_B) for name, each in pairs if abs(each) > 1e-4 * largest]
    row = table["row"].values.tolist().index(best["row"])
    scatter = float(table[f"power_{station}_se"].values[row])
    if np.isfinite(scatter):
        found.append((SCATTER, scatter, _TYPE_A))
    return sorted(found, key=lambda each: -each[1])


def _draw(axes: Axes, parts: list[tuple[str, float, str]]) -> None:
    places = np.arange(len(parts))[::-1]
    sizes = [size for _, size, _ in parts]
    axes.barh(places, sizes, height=0.72, color=[colour for *_, colour in parts])
    axes.set_yticks(places, [name for name, *_ in parts], fontsize=8)
    for place, size in zip(places, sizes, strict=True):
        axes.annotate(
            f"{size:.2g}".replace("-", "\N{MINUS SIGN}"),
            (size, float(place)),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
            color=DARK,
        )
    axes.set_xlim(0.0, 1.15 * max(sizes, default=1.0) or 1.0)
    axes.set_ylim(-0.6, len(parts) - 0.4)
    picture.style_axes(axes)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
