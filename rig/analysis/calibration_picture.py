"""Picture of a wave calibration: target and measured lines, their errors and the mean period."""

from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from rig.presentation import picture
from rig.presentation.picture import DARK

TARGET_COLOUR = "#9aa5ae"
COLOURS = ("#0b6e99", "#d1495b", "#2e933c", "#8d5a97")
MARKERS = ("o", "s", "^", "D")
_MIN_RELATIVE_ERROR = 1e-6  # %; a smaller error means that all periods were equal


def _style_axes(axes: Axes, ylabel: str) -> None:
    picture.style_axes(axes)
    axes.set_ylabel(ylabel, fontsize=8)
    axes.grid(alpha=0.25)


def _draw_lines(axes: Axes, table: xarray.Dataset) -> None:
    frequency = table["frequency"].values
    target = 1e3 * table["commanded_amplitude"].values
    axes.plot(frequency, target, color=TARGET_COLOUR, lw=2.5, label="target", zorder=1)
    for i, name in enumerate(table["probe"].values.tolist()):
        probe = table.sel(probe=name)
        error = 1e3 * probe["amplitude_se"].values
        axes.errorbar(
            frequency,
            1e3 * probe["amplitude"].values,
            yerr=error if np.isfinite(error).any() else None,
            fmt=MARKERS[i % 4],
            ms=2.2,
            lw=0.7,
            color=COLOURS[i % 4],
            alpha=0.8,
            label=name.replace("_", " "),
        )
    axes.set_ylim(bottom=0.0)
    _style_axes(axes, "amplitude, mm")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=5, frameon=False, fontsize=8)


def _relative_errors(probe: xarray.Dataset) -> Any:
    """Return the standard error of each line of a probe in % of the line; NaN if unknown."""
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = 100.0 * probe["amplitude_se"].values / probe["amplitude"].values
    return np.where(np.isfinite(relative) & (relative > _MIN_RELATIVE_ERROR), relative, np.nan)


def _draw_errors(axes: Axes, table: xarray.Dataset) -> None:
    frequency = table["frequency"].values
    for i, name in enumerate(table["probe"].values.tolist()):
        probe = table.sel(probe=name)
        relative = _relative_errors(probe)
        axes.plot(frequency, relative, MARKERS[i % 4], ms=2.2, color=COLOURS[i % 4])
        weak = probe["weak"].values == 1
        axes.plot(frequency[weak], relative[weak], "o", ms=7, mfc="none", mec=DARK, mew=0.9)
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    _style_axes(axes, "standard error, % of line")


def _draw_mean_period(axes: Axes, table: xarray.Dataset) -> None:
    time = table["time"].values
    for i, name in enumerate(table["probe"].values.tolist()):
        probe = table.sel(probe=name)
        mean, error = 1e3 * probe["mean_period"].values, 1e3 * probe["mean_period_se"].values
        axes.plot(time, mean, color=COLOURS[i % 4], lw=0.6)
        axes.fill_between(time, mean - error, mean + error, color=COLOURS[i % 4], alpha=0.3, lw=0)
    axes.margins(x=0.0)
    _style_axes(axes, "mean elevation, mm")
    axes.set_xlabel("time within the repeat period (wave clock), s", fontsize=8)


def write_picture(table: xarray.Dataset, path: Path) -> Path:
    """Write the picture: amplitudes by line, their relative errors if any, mean repeat period."""
    attributes = table.attrs
    probes = table["probe"].values.tolist()
    has_errors = any(np.isfinite(_relative_errors(table.sel(probe=name))).any() for name in probes)
    figure, body = picture.framed_figure(
        11.0,
        8.4 if has_errors else 6.0,
        f"Waves without the device: {attributes.get('campaign') or attributes.get('sea', '')}",
        attributes,
        "" if has_errors else "no standard error: periods equal, or only one",
        _subtitle(table),
    )
    panels: list[Any] = list(body.subplots(3 if has_errors else 2, 1))
    _draw_lines(panels[0], table)
    if has_errors:
        panels[1].sharex(panels[0])
        _draw_errors(panels[1], table)
    panels[-2].set_xlabel(
        "frequency, Hz" + ("   (circles: too weak for identification)" if has_errors else ""),
        fontsize=8,
    )
    _draw_mean_period(panels[-1], table)
    return picture.save(figure, path)


def _subtitle(table: xarray.Dataset) -> str:
    """Return the sea, its target Hm0 and the measured Hm0 at each probe."""
    measured = ", ".join(
        f"{name.replace('_', ' ')} {1e3 * height:.1f}"
        for name, height in zip(
            table["probe"].values.tolist(), table["hm0"].values.tolist(), strict=True
        )
    )
    target = 1e3 * table.attrs["hm0_asked_m"]
    return f"{table.attrs.get('sea', '')}; Hm0 in mm: target {target:.1f}, {measured}"
