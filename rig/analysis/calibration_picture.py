"""The picture of a wave calibration: lines asked and found, their error, and the mean period."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from rig.analysis import picture
from rig.analysis.picture import INK

ASKED = "#9aa5ae"
COLOURS = ("#0b6e99", "#d1495b", "#2e933c", "#8d5a97")
MARKERS = ("o", "s", "^", "D")
_ROUNDING = 1e-6  # %: a smaller error says that every period was the same


def _plain(axes: Axes, ylabel: str) -> None:
    picture.quiet(axes)
    axes.set_ylabel(ylabel, fontsize=8)
    axes.grid(alpha=0.25)


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


def _shares(one: xarray.Dataset) -> Any:
    """Standard error of each line of a probe, % of the line; NaN where there is none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        share = 100.0 * one["amplitude_se"].values / one["amplitude"].values
    return np.where(np.isfinite(share) & (share > _ROUNDING), share, np.nan)


def _errors(axes: Axes, table: xarray.Dataset) -> None:
    frequency = table["frequency"].values
    for i, name in enumerate(table["probe"].values.tolist()):
        one = table.sel(probe=name)
        share = _shares(one)
        axes.plot(frequency, share, MARKERS[i % 4], ms=2.2, color=COLOURS[i % 4])
        weak = one["weak"].values == 1
        axes.plot(frequency[weak], share[weak], "o", ms=7, mfc="none", mec=INK, mew=0.9)
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    _plain(axes, "standard error, % of line")


def _period(axes: Axes, table: xarray.Dataset) -> None:
    time = table["time"].values
    for i, name in enumerate(table["probe"].values.tolist()):
        one = table.sel(probe=name)
        mean, error = 1e3 * one["mean_period"].values, 1e3 * one["mean_period_se"].values
        axes.plot(time, mean, color=COLOURS[i % 4], lw=0.6)
        axes.fill_between(time, mean - error, mean + error, color=COLOURS[i % 4], alpha=0.3, lw=0)
    axes.margins(x=0.0)
    _plain(axes, "mean period, mm")
    axes.set_xlabel("wave clock within the repeat period, s", fontsize=8)


def write_picture(table: xarray.Dataset, path: Path) -> Path:
    """Amplitudes by line, their relative errors where there are any, and the mean repeat period."""
    attributes = table.attrs
    probes = table["probe"].values.tolist()
    uncertain = any(np.isfinite(_shares(table.sel(probe=name))).any() for name in probes)
    figure, body = picture.framed(
        11.0,
        8.4 if uncertain else 6.0,
        f"Waves without the device: {attributes.get('campaign') or attributes.get('sea', '')}",
        attributes,
        "" if uncertain else "no error: every period the same, or only one",
        _heights(table),
    )
    panels: list[Any] = list(body.subplots(3 if uncertain else 2, 1))
    _lines(panels[0], table)
    if uncertain:
        panels[1].sharex(panels[0])
        _errors(panels[1], table)
    panels[-2].set_xlabel(
        "frequency, Hz" + ("   (ringed: too weak to divide by)" if uncertain else ""), fontsize=8
    )
    _period(panels[-1], table)
    return picture.save(figure, path)


def _heights(table: xarray.Dataset) -> str:
    """The sea, and Hm0 asked and found at each probe."""
    found = ", ".join(
        f"{name.replace('_', ' ')} {1e3 * height:.1f}"
        for name, height in zip(
            table["probe"].values.tolist(), table["hm0"].values.tolist(), strict=True
        )
    )
    asked = 1e3 * table.attrs["hm0_asked_m"]
    return f"{table.attrs.get('sea', '')}; Hm0 in mm: asked {asked:.1f}, {found}"
