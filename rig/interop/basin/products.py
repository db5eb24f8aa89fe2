"""Products of a merge in a run's folder: resampled channels, row means, and the clocks."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes

from rig.interop.basin.align import MAX_EDGE_DIFFERENCE, Alignment, format_alignment
from rig.interop.basin.merge import MergedRecords, to_json
from rig.presentation import picture
from rig.realtime.sequence import Phase
from rig.recording.channel_file import Recording

LINE_COLOUR, EDGE_COLOUR = "#0b6e99", picture.ACCENT
_SMOOTHING_LAGS = 30  # window of the moving average through the residuals


def write_products(merged: MergedRecords, folder: Path) -> list[Path]:
    """Write the products of a merge to a folder; return the files written.

    They are ``merged.nc``, ``merged.json``, ``merged.png`` and, for measured rows,
    ``merged_rows.csv``. Files of these names from an earlier merge are replaced.
    """
    netcdf_path, json_path = folder / "merged.nc", folder / "merged.json"
    merged.table.to_netcdf(netcdf_path, engine="h5netcdf")
    json_path.write_text(json.dumps(to_json(merged), indent=2, ensure_ascii=False) + "\n")
    rows = row_means(merged.table)
    written = [netcdf_path, json_path, write_picture(merged, folder / "merged.png")]
    if not rows:
        return written
    csv_path = folder / "merged_rows.csv"
    with csv_path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return [*written, csv_path]


def row_means(table: xarray.Dataset) -> list[dict[str, Any]]:
    """Return mean and standard deviation of every channel over each row's measured window.

    The last attempt at a row counts. A window that a record does not cover completely gives NaN.
    """
    if "plan.row" not in table:
        return []
    row, phase = table["plan.row"].values, table["plan.phase"].values
    attempt = table["plan.attempt"].values
    names = [str(name) for name in table.data_vars if not str(name).startswith("plan.")]
    means = []
    for number in np.unique(row[(phase == Phase.MEASURE) & (row >= 0)]).tolist():
        inside = (row == number) & (phase == Phase.MEASURE)
        inside &= attempt == attempt[inside].max()
        entry: dict[str, Any] = {"row": number, "samples": int(inside.sum())}
        for name in names:
            values = table[name].values[inside]
            unit = table[name].attrs["units"]
            entry[f"{name} mean [{unit}]"] = float(values.mean())
            entry[f"{name} deviation [{unit}]"] = float(values.std())
        means.append(entry)
    return means


def write_picture(merged: MergedRecords, path: Path) -> Path:
    """Draw each file's lags minus the fitted clock, and the residual of its trigger."""
    count = len(merged.records)
    figure, body = picture.framed_figure(
        10.0,
        2.6 * count + 0.2,
        f"Clocks of merged records: {picture.campaign_name(merged.table.attrs)}",
        merged.table.attrs,
        "",
        "residuals of the fit of offset and drift; run minus recorder",
        "; ".join(merged.alarms),
    )
    panels: Any = np.atleast_1d(body.subplots(count, 1))
    for axes, (source, recording, alignment) in zip(panels, merged.records, strict=True):
        _plot_residuals(axes, recording, alignment)
        axes.set_title(f"{source.name}:  {format_alignment(alignment)}", fontsize=8.5, loc="left")
    panels[-1].set_xlabel("recorder's time, s", fontsize=8)
    return picture.save(figure, path)


def _plot_residuals(axes: Axes, record: Recording, alignment: Alignment) -> None:
    if alignment.lags is not None:
        time = alignment.lags.time
        width = min(_SMOOTHING_LAGS, len(time))
        weights = np.full(width, 1.0 / width)
        middle = np.convolve(time, weights, "valid")
        smooth = _residuals_ms(
            alignment, middle, np.convolve(alignment.residuals, weights, "valid")
        )
        size = 3.0 if len(time) < 300 else 1.5
        values = _residuals_ms(alignment, time, alignment.residuals)
        axes.plot(
            time, values, ".", ms=size, color=LINE_COLOUR, alpha=0.45,
            label="each lag",
        )  # fmt: skip
        axes.plot(middle, smooth, color=LINE_COLOUR, lw=1.2, label=f"mean of {width}")
    else:
        axes.text(
            0.5, 0.2, "no sine: only one moment is known, the drift is unknown",
            fontsize=8, ha="center", color=picture.MUTED, transform=axes.transAxes,
        )  # fmt: skip
    if alignment.edge_time is not None and alignment.edge_residual is not None:
        tolerance = 1e3 * MAX_EDGE_DIFFERENCE
        axes.errorbar(
            alignment.edge_time, 1e3 * alignment.edge_residual, yerr=tolerance,
            fmt="D", ms=4, color=EDGE_COLOUR, lw=1.0, capsize=3,
            label=f"trigger ± {tolerance:g} ms (alarm beyond)",
        )  # fmt: skip
    axes.axhline(0.0, color=picture.FRAME, lw=0.8, zorder=0)
    axes.set_xlim(record.time[0], record.time[-1])
    axes.set_ylabel("ms", fontsize=8)
    if axes.get_legend_handles_labels()[1]:
        axes.legend(loc="upper right", ncols=3, frameon=False, fontsize=7)
    axes.margins(y=0.3)
    picture.style_axes(axes)


def _residuals_ms(alignment: Alignment, time: Any, residuals: Any) -> Any:
    """Return residuals (s) in ms, with a slip added back so that the plot shows it."""
    return 1e3 * (residuals + np.where(time >= alignment.clock.slip_at, alignment.clock.slip, 0.0))
