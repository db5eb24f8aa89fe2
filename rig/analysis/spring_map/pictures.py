"""The spring map as pictures: Figs. 4-1 to 4-4 of the MASK4 report (Sandia) on one page."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, TwoSlopeNorm

from rig.analysis import picture
from rig.analysis.phrases import signed
from rig.analysis.picture import INK, MARK, SOFT

_BY_STATION = "viridis"
_SIGNED = "RdBu_r"
_TABLE, _SMALL_RATE = "#0b6e99", "#8fb8c9"


def write_pictures(table: xarray.Dataset, folder: Path) -> list[Path]:
    """``spring_map.png``: torque and stator force, rate and natural frequency over the stator."""
    figure, body = picture.framed(
        13.0,
        8.2,
        f"Magnetic spring map: {picture.campaign(table.attrs)}",
        table.attrs,
        "a positive rate restores",
        f"hoist {table.attrs.get('hoist', '')}; {table.sizes['station']} stator positions",
    )
    panels: Any = body.subplots(2, 3)
    _surface(body, panels[0, 0], table, "torque", "Spring torque, N·m")
    _lines(body, panels[0, 1], table, "torque", "Torque and its line of best fit, N·m")
    _rates(panels[0, 2], table)
    _surface(body, panels[1, 0], table, "stator_force", "Stator force, N; hatched: reversed")
    _lines(body, panels[1, 1], table, "stator_force", "Stator force, N; rings: it reverses")
    _frequencies(panels[1, 2], table)
    return [picture.save(figure, folder / "spring_map.png")]


def _degrees(table: xarray.Dataset) -> Any:
    return np.degrees(table["angle"].values)


def _titled(axes: Axes, title: str, x: str, y: str = "") -> None:
    picture.quiet(axes)
    axes.set_title(title, fontsize=9.5, color=INK, loc="left")
    axes.set_xlabel(x, fontsize=8, color=SOFT)
    axes.set_ylabel(y, fontsize=8, color=SOFT)


def _surface(body: Any, axes: Axes, table: xarray.Dataset, name: str, title: str) -> None:
    """One field over rotor angle and stator position, the stations measured as lines of dots."""
    angle, station = _degrees(table), table["station"].values
    values = table[name].values
    most = float(np.nanmax(np.abs(values)))
    if name == "torque" or np.nanmin(values) < 0.0 < np.nanmax(values):
        least = -most if name == "torque" else float(np.nanmin(values))
        norm: Normalize = TwoSlopeNorm(0.0, least, float(np.nanmax(values)))
    else:
        norm = Normalize(float(np.nanmin(values)), float(np.nanmax(values)))
    if len(station) > 1:
        drawn = axes.contourf(angle, station, values, levels=24, norm=norm, cmap=_SIGNED)
        drawn.set_edgecolor("face")
        axes.contour(angle, station, values, levels=[0.0], colors=INK, linewidths=0.9)
        if name == "stator_force":
            _hatch(axes, angle, station, values)
    for at in station:
        axes.plot(angle[::4], np.full(len(angle[::4]), at), ".", ms=0.9, color=INK, alpha=0.55)
    bar = body.colorbar(ScalarMappable(norm, _SIGNED), ax=axes, shrink=0.9, pad=0.02)
    bar.ax.tick_params(labelsize=7)
    bar.outline.set_visible(False)
    _titled(axes, title, "rotor angle from balance, deg", "stator position, %")


def _hatch(axes: Axes, angle: Any, station: Any, values: Any) -> None:
    """Hatch where the force has not the sign that it has at balance."""
    middle = values[:, np.argmin(np.abs(angle))]
    turned = values * np.sign(middle)[:, np.newaxis]
    if np.nanmin(turned) < 0.0:
        with np.errstate(invalid="ignore"):
            axes.contourf(
                angle, station, turned, levels=[np.nanmin(turned) * 1.01, 0.0],
                colors="none", hatches=["////"],
            )  # fmt: skip


def _lines(body: Any, axes: Axes, table: xarray.Dataset, name: str, title: str) -> None:
    angle, station = _degrees(table), table["station"].values
    half = math.degrees(float(table.attrs["fit_half_angle_rad"]))
    low, high = float(station.min()), float(station.max())
    norm = Normalize(low, high if high > low else low + 1.0)
    colours = ScalarMappable(norm, _BY_STATION)
    axes.axhline(0.0, color=SOFT, lw=0.6)
    if name == "torque":
        axes.axvspan(-half, half, color="#eef2f5", lw=0, zorder=0)
    for i, at in enumerate(station):
        colour: Any = colours.to_rgba(np.array(at))
        values = table[name].values[i]
        axes.plot(angle, values, color=colour, lw=1.3)
        if name == "torque":
            _fitted(axes, table, i, half)
        else:
            _ring(axes, table, i, values)
    bar = body.colorbar(colours, ax=axes, shrink=0.9, pad=0.02)
    bar.ax.tick_params(labelsize=7)
    bar.outline.set_visible(False)
    bar.set_label("stator position, %", fontsize=7, color=SOFT)
    axes.margins(x=0.0)
    _titled(axes, title, "rotor angle from balance, deg")


def _fitted(axes: Axes, table: xarray.Dataset, i: int, half: float) -> None:
    rate, lever = float(table["rate"].values[i]), float(table.attrs["metres_per_radian"])
    ends = np.array([-half, half])
    line = rate * lever * lever * np.radians(ends)
    label = "line of best fit over ±39.27°" if i == 0 else None
    axes.plot(ends, line, "--", color=INK, lw=0.8, label=label)
    if label:
        axes.legend(fontsize=7, frameon=False, loc="upper center")


def _ring(axes: Axes, table: xarray.Dataset, i: int, values: Any) -> None:
    for name in ("reversal_below", "reversal_above"):
        at = float(table[name].values[i])
        if math.isfinite(at):
            axes.plot(math.degrees(at), 0.0, "o", ms=6, mfc="none", mec=MARK, mew=1.2, zorder=5)


def _rates(axes: Axes, table: xarray.Dataset) -> None:
    station = table["station"].values
    axes.axhline(0.0, color=SOFT, lw=0.6)
    small = 1e-3 * table["rate_small"].values
    axes.plot(station, small, "s-", ms=3.5, lw=0.9, color=_SMALL_RATE, label="within ±10°")
    axes.plot(
        station, 1e-3 * table["rate_column"].values, "x", ms=7, color=MARK,
        label="±39.27°, column load cell",
    )  # fmt: skip
    axes.plot(
        station, 1e-3 * table["rate"].values, "o-", ms=4.5, lw=1.4, color=_TABLE,
        label="±39.27°, slew load cell: the map",
    )  # fmt: skip
    for at, rate in zip(station, table["rate"].values, strict=True):
        if math.isfinite(rate):
            axes.annotate(
                signed(float(rate)), (at, 1e-3 * rate), (-5, -9), textcoords="offset points",
                fontsize=6.5, color=INK, ha="right",
            )  # fmt: skip
    axes.legend(fontsize=7, frameon=False)
    axes.grid(alpha=0.25)
    axes.margins(x=0.14, y=0.1)
    _titled(axes, "Spring rate, kN/m", "stator position, %")


def _frequencies(axes: Axes, table: xarray.Dataset) -> None:
    frequency = table["natural_frequency"].values
    if not np.isfinite(frequency).any():
        axes.text(
            0.5, 0.5, "the rig file says no\nspring.mapping", ha="center", va="center",
            transform=axes.transAxes, fontsize=9, color=SOFT,
        )  # fmt: skip
    stiffness, mass = table.attrs["hydrostatic_n_per_m"], table.attrs["moving_mass_kg"]
    alone = math.sqrt(stiffness / mass) / (2.0 * math.pi)
    if math.isfinite(alone):
        axes.axhline(alone, color=SOFT, lw=0.8, ls="--")
        axes.annotate(
            f"no spring: {alone:.3f} Hz", (0.02, alone), (0, 3), textcoords="offset points",
            xycoords=("axes fraction", "data"), fontsize=7, color=SOFT,
        )  # fmt: skip
    axes.plot(table["station"].values, frequency, "o-", ms=4.5, lw=1.4, color=_TABLE)
    axes.grid(alpha=0.25)
    axes.margins(x=0.08)
    _titled(axes, "Natural frequency by eq. 3.1, Hz", "stator position, %")
