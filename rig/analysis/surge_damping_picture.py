"""The picture of a surge damping determination: stroke, force and heave power over the damping."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from rig.analysis import picture
from rig.analysis.picture import INK, MARK, SOFT
from rig.analysis.surge_damping import Choice, answer, curve

_LINE = "#0b6e99"
_GUIDE = "#8d5a97"


def write_picture(choice: Choice, attributes: Mapping[Any, Any], path: Path) -> Path:
    """Four panels over one axis of damping; what is not allowed is shaded."""
    figure, body = picture.framed(
        10.0, 7.0, f"Surge damping: {picture.campaign(attributes)}", attributes,
        "negative is absorbed", answer(choice),
    )  # fmt: skip
    panels: Any = body.subplots(2, 2, sharex=True)
    _panel(panels[0, 0], choice, "stroke", "Surge stroke either way, m")
    panels[0, 0].axhspan(choice.stroke, 10.0, color="#f3dfe2", lw=0, zorder=0)
    _label(panels[0, 0], choice.stroke, f"allowed: {choice.stroke:.3f} m")
    _panel(panels[0, 1], choice, "force", "Surge drive force at the wave's frequency, N")
    _panel(panels[1, 0], choice, "power", "Heave power, column load cell, W")
    least = choice.kept * min(row.power for row in choice.rows)
    panels[1, 0].axhspan(least, least + 1e4, color="#f3dfe2", lw=0, zorder=0)
    _label(panels[1, 0], least, f"kept: {100.0 * choice.kept:.0f} % of the best")
    _panel(panels[1, 1], choice, "guide", "Lost between column and shaft, W", _GUIDE)
    for axes in panels[1]:
        axes.set_xlabel("surge damping, N·s/m", fontsize=8, color=SOFT)
    return picture.save(figure, path)


def _panel(axes: Axes, choice: Choice, name: str, title: str, colour: str = _LINE) -> None:
    damping = np.array([row.damping for row in choice.rows])
    value = np.array([getattr(row, name) for row in choice.rows])
    fine = np.geomspace(damping[0], damping[-1], 300)
    along = curve(choice.rows, name)
    axes.plot(fine, along(np.log(fine)), color=colour, lw=1.2)
    axes.plot(damping, value, "o", ms=4.5, color=colour)
    if math.isfinite(choice.damping):
        axes.axvline(choice.damping, color=MARK, lw=1.0, ls="--")
        at = float(along(math.log(choice.damping)))
        axes.plot(choice.damping, at, "D", ms=7, mfc="none", mec=MARK, mew=1.4)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator([250, 500, 1000, 2000, 4000, 8000, 16000]))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    low, high = float(value.min()), float(value.max())
    bounds = {"stroke": (0.0, max(high, 1.1 * choice.stroke)),
              "power": (low, max(high, choice.kept * low))}.get(name, (low, high))  # fmt: skip
    room = 0.08 * (bounds[1] - bounds[0]) or 1.0
    axes.set_ylim(bounds[0] - (0.0 if name == "stroke" else room), bounds[1] + room)
    axes.grid(alpha=0.25)
    picture.quiet(axes)
    axes.set_title(title, fontsize=9.5, color=INK, loc="left")


def _label(axes: Axes, at: float, text: str) -> None:
    axes.axhline(at, color=MARK, lw=0.8)
    axes.annotate(
        text, (0.98, at), (0, 3), xycoords=("axes fraction", "data"), textcoords="offset points",
        fontsize=7, color=MARK, ha="right",
    )  # fmt: skip
