"""Picture of the spring map: Figs. 4-1 to 4-4 of the MASK4 report (Sandia) on one page."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, TwoSlopeNorm

from rig.presentation import picture
from rig.presentation.phrases import format_signed
from rig.presentation.picture import ACCENT, DARK, MUTED

_STATION_COLOURS = "viridis"
_SIGNED_COLOURS = "RdBu_r"
_RATE_COLOUR, _SMALL_RATE_COLOUR = "#0b6e99", "#8fb8c9"


def write_pictures(table: xarray.Dataset, folder: Path) -> list[Path]:
    """Write ``spring_map.png``: torque, stator force, rate and natural frequency.

    All of them are drawn over stator position.
    """
    figure, body = picture.framed_figure(
        13.0,
        8.2,
        f"Magnetic spring map: {picture.campaign_name(table.attrs)}",
        table.attrs,
        "a positive rate is restoring",
        f"hoist {table.attrs.get('hoist', '')}; {table.sizes['station']} stator positions",
    )
    panels: Any = body.subplots(2, 3)
    _draw_surface(body, panels[0, 0], table, "torque", "Spring torque, N·m")
    _draw_curves(body, panels[0, 1], table, "torque", "Torque and linear fit, N·m")
    _draw_rates(panels[0, 2], table)
    _draw_surface(body, panels[1, 0], table, "stator_force", "Stator force, N (hatched: reversed)")
    _draw_curves(body, panels[1, 1], table, "stator_force", "Stator force, N (circles: reversal)")
    _draw_frequencies(panels[1, 2], table)
    return [picture.save(figure, folder / "spring_map.png")]


def _angle_degrees(table: xarray.Dataset) -> Any:
    return np.degrees(table["angle"].values)


def _label_axes(axes: Axes, title: str, x: str, y: str = "") -> None:
    picture.style_axes(axes)
    axes.set_title(title, fontsize=9.5, color=DARK, loc="left")
    axes.set_xlabel(x, fontsize=8, color=MUTED)
    axes.set_ylabel(y, fontsize=8, color=MUTED)


def _draw_colour_bar(body: Any, axes: Axes, colours: ScalarMappable, label: str = "") -> None:
    bar = body.colorbar(colours, ax=axes, shrink=0.9, pad=0.02)
    bar.ax.tick_params(labelsize=7)
    bar.outline.set_visible(False)
    bar.set_label(label, fontsize=7, color=MUTED)


def _draw_surface(body: Any, axes: Axes, table: xarray.Dataset, name: str, title: str) -> None:
    """Draw one field over rotor angle and stator position; dots mark the measured stations."""
    angle, station = _angle_degrees(table), table["station"].values
    values = table[name].values
    largest = float(np.nanmax(np.abs(values)))
    if name == "torque" or np.nanmin(values) < 0.0 < np.nanmax(values):
        smallest = -largest if name == "torque" else float(np.nanmin(values))
        norm: Normalize = TwoSlopeNorm(0.0, smallest, float(np.nanmax(values)))
    else:
        norm = Normalize(float(np.nanmin(values)), float(np.nanmax(values)))
    if len(station) > 1:
        filled = axes.contourf(angle, station, values, levels=24, norm=norm, cmap=_SIGNED_COLOURS)
        filled.set_edgecolor("face")
        axes.contour(angle, station, values, levels=[0.0], colors=DARK, linewidths=0.9)
        if name == "stator_force":
            _hatch_reversed(axes, angle, station, values)
    for position in station:
        axes.plot(
            angle[::4], np.full(len(angle[::4]), position), ".", ms=0.9, color=DARK, alpha=0.55
        )
    _draw_colour_bar(body, axes, ScalarMappable(norm, _SIGNED_COLOURS))
    _label_axes(axes, title, "rotor angle from balance, deg", "stator position, %")


def _hatch_reversed(axes: Axes, angle: Any, station: Any, values: Any) -> None:
    """Hatch the region where the force has the opposite sign of balance."""
    at_balance = values[:, np.argmin(np.abs(angle))]
    relative = values * np.sign(at_balance)[:, np.newaxis]
    if np.nanmin(relative) < 0.0:
        with np.errstate(invalid="ignore"):
            axes.contourf(
                angle, station, relative, levels=[np.nanmin(relative) * 1.01, 0.0],
                colors="none", hatches=["////"],
            )  # fmt: skip


def _draw_curves(body: Any, axes: Axes, table: xarray.Dataset, name: str, title: str) -> None:
    angle, station = _angle_degrees(table), table["station"].values
    half_angle = math.degrees(float(table.attrs["fit_half_angle_rad"]))
    ends, lever = np.array([-half_angle, half_angle]), float(table.attrs["metres_per_radian"])
    low, high = float(station.min()), float(station.max())
    norm = Normalize(low, high if high > low else low + 1.0)
    colours = ScalarMappable(norm, _STATION_COLOURS)
    axes.axhline(0.0, color=MUTED, lw=0.6)
    if name == "torque":
        axes.axvspan(*ends, color="#eef2f5", lw=0, zorder=0)
    for i, position in enumerate(station):
        colour: Any = colours.to_rgba(np.array(position))
        values = table[name].values[i]
        axes.plot(angle, values, color=colour, lw=1.3)
        if name == "torque":
            line = float(table["rate"].values[i]) * lever * lever * np.radians(ends)
            label = "linear fit over ±39.27°" if i == 0 else None
            axes.plot(ends, line, "--", color=DARK, lw=0.8, label=label)
            continue
        style: dict[str, Any] = {"ms": 6, "mfc": "none", "mec": ACCENT, "mew": 1.2, "zorder": 5}
        for reversal in (table["reversal_below"].values[i], table["reversal_above"].values[i]):
            if math.isfinite(reversal):
                axes.plot(math.degrees(reversal), 0.0, "o", **style)
    _draw_colour_bar(body, axes, colours, "stator position, %")
    axes.margins(x=0.0)
    if name == "torque":
        axes.legend(fontsize=7, frameon=False, loc="upper center")
    _label_axes(axes, title, "rotor angle from balance, deg")


def _draw_rates(axes: Axes, table: xarray.Dataset) -> None:
    station = table["station"].values
    axes.axhline(0.0, color=MUTED, lw=0.6)
    small_rate = 1e-3 * table["rate_small"].values
    axes.plot(
        station, small_rate, "s-", ms=3.5, lw=0.9, color=_SMALL_RATE_COLOUR, label="within ±10°"
    )
    axes.plot(
        station, 1e-3 * table["rate_column"].values, "x", ms=7, color=ACCENT,
        label="±39.27°, column load cell",
    )  # fmt: skip
    axes.plot(
        station, 1e-3 * table["rate"].values, "o-", ms=4.5, lw=1.4, color=_RATE_COLOUR,
        label="±39.27°, slew load cell (map)",
    )  # fmt: skip
    for position, rate in zip(station, table["rate"].values, strict=True):
        if math.isfinite(rate):
            axes.annotate(
                format_signed(float(rate)), (position, 1e-3 * rate), (-5, -9),
                textcoords="offset points", fontsize=6.5, color=DARK, ha="right",
            )  # fmt: skip
    axes.legend(fontsize=7, frameon=False)
    axes.grid(alpha=0.25)
    axes.margins(x=0.14, y=0.1)
    _label_axes(axes, "Spring rate, kN/m", "stator position, %")


def _draw_frequencies(axes: Axes, table: xarray.Dataset) -> None:
    frequency = table["natural_frequency"].values
    if not np.isfinite(frequency).any():
        axes.text(
            0.5, 0.5, "the rig file lacks\nspring.mapping", ha="center", va="center",
            transform=axes.transAxes, fontsize=9, color=MUTED,
        )  # fmt: skip
    stiffness, mass = table.attrs["hydrostatic_n_per_m"], table.attrs["moving_mass_kg"]
    without_spring = math.sqrt(stiffness / mass) / (2.0 * math.pi)
    if math.isfinite(without_spring):
        axes.axhline(without_spring, color=MUTED, lw=0.8, ls="--")
        axes.annotate(
            f"no spring: {without_spring:.3f} Hz", (0.02, without_spring), (0, 3),
            textcoords="offset points", xycoords=("axes fraction", "data"), fontsize=7,
            color=MUTED,
        )  # fmt: skip
    axes.plot(table["station"].values, frequency, "o-", ms=4.5, lw=1.4, color=_RATE_COLOUR)
    axes.grid(alpha=0.25)
    axes.margins(x=0.08)
    _label_axes(axes, "Natural frequency by eq. 3.1, Hz", "stator position, %")
