"""The picture of a wave calibration: lines asked and found, their error, and the mean period."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rig.analysis import words

INK = "#22303c"
ASKED = "#9aa5ae"
COLOURS = ("#0b6e99", "#d1495b", "#2e933c", "#8d5a97")
MARKERS = ("o", "s", "^", "D")
_ROUNDING = 1e-6  # %: a smaller error says that every period was the same


def _plain(axes: Axes, ylabel: str) -> None:
    axes.set_ylabel(ylabel)
    axes.grid(alpha=0.25)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _lines(axes: Axes, table: xarray.Dataset) -> None:
    frequency = table["frequency"].values
    asked = 1e3 * table["asked_amplitude"].values
    axes.plot(frequency, asked, color=ASKED, lw=2.5, label="asked", zorder=1)
    for i, name in enumerate(table["probe"].values.tolist()):
        one = table.sel(probe=name)
        error = 1e3 * one["amplitude_se"].values
        axes.errorbar(
            frequency,
            1e3 * one["amplitude"].values,
            yerr=error if np.isfinite(error).any() else None,
            fmt=MARKERS[i % 4],
            ms=2.2,
            lw=0.7,
            color=COLOURS[i % 4],
            alpha=0.8,
            label=name.replace("_", " "),
        )
    axes.set_ylim(bottom=0.0)
    _plain(axes, "amplitude, mm")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=5, frameon=False, fontsize=8)


def _errors(axes: Axes, table: xarray.Dataset) -> None:
    frequency = table["frequency"].values
    shown = False
    for i, name in enumerate(table["probe"].values.tolist()):
        one = table.sel(probe=name)
        with np.errstate(divide="ignore", invalid="ignore"):
            share = 100.0 * one["amplitude_se"].values / one["amplitude"].values
        good = np.isfinite(share) & (share > _ROUNDING)
        shown = shown or bool(good.any())
        axes.plot(frequency[good], share[good], MARKERS[i % 4], ms=2.2, color=COLOURS[i % 4])
        weak = (one["weak"].values == 1) & good
        axes.plot(frequency[weak], share[weak], "o", ms=7, mfc="none", mec=INK, mew=0.9)
    if shown:
        axes.set_yscale("log")
    else:
        axes.text(
            0.5, 0.5, "every period the same, or only one", ha="center", transform=axes.transAxes
        )
    _plain(axes, "standard error, % of line")
    axes.set_xlabel("frequency, Hz   (ringed: too weak to divide by)")


def _period(axes: Axes, table: xarray.Dataset) -> None:
    time = table["time"].values
    for i, name in enumerate(table["probe"].values.tolist()):
        one = table.sel(probe=name)
        mean, error = 1e3 * one["mean_period"].values, 1e3 * one["mean_period_se"].values
        axes.plot(time, mean, color=COLOURS[i % 4], lw=0.6)
        axes.fill_between(time, mean - error, mean + error, color=COLOURS[i % 4], alpha=0.3, lw=0)
    axes.margins(x=0.0)
    _plain(axes, "mean period, mm")
    axes.set_xlabel("wave clock within the repeat period, s")


def write_picture(table: xarray.Dataset, path: Path) -> Path:
    """Amplitudes by line with errors, relative errors, and the mean repeat period."""
    figure = Figure(figsize=(11.0, 9.0), layout="constrained")
    top, middle, bottom = figure.subplots(3, 1)
    axes_of: Any = (top, middle, bottom)
    for axes, draw in zip(axes_of, (_lines, _errors, _period), strict=True):
        draw(axes, table)
    heights = "   ".join(
        f"{name.replace('_', ' ')} {1e3 * height:.1f}"
        for name, height in zip(
            table["probe"].values.tolist(), table["hm0"].values.tolist(), strict=True
        )
    )
    attributes = table.attrs
    figure.suptitle(
        f"Wave calibration, run {attributes.get('run', 'unknown')}   "
        f"[{words.rung_stamp(str(attributes.get('rung', '')))}]\n"
        f"{attributes.get('sea', '')}\n"
        f"Hm0, mm: asked {1e3 * attributes['hm0_asked_m']:.1f}   {heights}",
        fontsize=10,
        color=INK,
        x=0.01,
        ha="left",
    )
    figure.savefig(path, dpi=140)
    return path
