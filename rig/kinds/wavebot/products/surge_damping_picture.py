"""Picture of a surge damping determination: stroke, force and heave power over the damping."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from rig.kinds.wavebot.products.surge_damping import (
    DampingChoice,
    interpolate_column,
    recommendation,
)
from rig.presentation import picture
from rig.presentation.picture import ACCENT, DARK, MUTED

_LINE_COLOUR = "#0b6e99"
_LOSS_COLOUR = "#8d5a97"


def write_picture(choice: DampingChoice, attributes: Mapping[Any, Any], path: Path) -> Path:
    """Write four panels over damping; the regions that are not allowed are shaded."""
    figure, body = picture.framed_figure(
        10.0, 7.0, f"Surge damping: {picture.campaign_name(attributes)}", attributes,
        "negative is absorbed", recommendation(choice),
    )  # fmt: skip
    panels: Any = body.subplots(2, 2, sharex=True)
    _draw_panel(panels[0, 0], choice, "stroke", "Surge stroke (largest deviation from zero), m")
    panels[0, 0].axhspan(choice.stroke, 10.0, color="#f3dfe2", lw=0, zorder=0)
    _draw_bound(panels[0, 0], choice.stroke, f"allowed: {choice.stroke:.3f} m")
    _draw_panel(panels[0, 1], choice, "force", "Surge drive force amplitude at wave frequency, N")
    _draw_panel(panels[1, 0], choice, "power", "Heave power, column load cell, W")
    power_bound = choice.kept_share * min(row.power for row in choice.rows)
    panels[1, 0].axhspan(power_bound, power_bound + 1e4, color="#f3dfe2", lw=0, zorder=0)
    _draw_bound(
        panels[1, 0], power_bound, f"required: {100.0 * choice.kept_share:.0f} % of the best"
    )
    loss = "Loss from column load cell to shaft, W"
    _draw_panel(panels[1, 1], choice, "guide", loss, _LOSS_COLOUR)
    for axes in panels[1]:
        axes.set_xlabel("surge damping, N·s/m", fontsize=8, color=MUTED)
    return picture.save(figure, path)


def _draw_panel(
    axes: Axes, choice: DampingChoice, name: str, title: str, colour: str = _LINE_COLOUR
) -> None:
    damping = np.array([row.damping for row in choice.rows])
    value = np.array([getattr(row, name) for row in choice.rows])
    fine = np.geomspace(damping[0], damping[-1], 300)
    interpolated = interpolate_column(choice.rows, name)
    axes.plot(fine, interpolated(np.log(fine)), color=colour, lw=1.2)
    axes.plot(damping, value, "o", ms=4.5, color=colour)
    if math.isfinite(choice.damping):
        axes.axvline(choice.damping, color=ACCENT, lw=1.0, ls="--")
        value_at = float(interpolated(math.log(choice.damping)))
        axes.plot(choice.damping, value_at, "D", ms=7, mfc="none", mec=ACCENT, mew=1.4)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator([250, 500, 1000, 2000, 4000, 8000, 16000]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    low, high = float(value.min()), float(value.max())
    bounds = (low, high)
    if name == "stroke":
        bounds = (0.0, max(high, 1.1 * choice.stroke))
    elif name == "power":
        bounds = (low, max(high, choice.kept_share * low))
    margin = 0.08 * (bounds[1] - bounds[0]) or 1.0
    axes.set_ylim(bounds[0] - (0.0 if name == "stroke" else margin), bounds[1] + margin)
    axes.grid(alpha=0.25)
    picture.style_axes(axes)
    axes.set_title(title, fontsize=9.5, color=DARK, loc="left")


def _draw_bound(axes: Axes, at: float, text: str) -> None:
    axes.axhline(at, color=ACCENT, lw=0.8)
    axes.annotate(
        text, (0.98, at), (0, 3), xycoords=("axes fraction", "data"), textcoords="offset points",
        fontsize=7, color=ACCENT, ha="right",
    )  # fmt: skip
