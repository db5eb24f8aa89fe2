"""What a merge leaves in a run's folder: the channels on the run's time, by row, and the clocks."""

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes

from rig.analysis import picture
from rig.interop.basin.align import DISAGREE, Alignment, in_words
from rig.interop.basin.merge import Merged, as_json
from rig.interop.basin.recording import Recording
from rig.realtime.sequence import Phase

LINE, EDGE = "#0b6e99", picture.ACCENT
_SMOOTH = 30  # lags, of the line through the residuals


def write(merged: Merged, folder: Path) -> list[Path]:
    """``merged.nc``, ``merged_rows.csv`` where rows were measured, ``merged.json``, ``merged.png``.

    Gives the files written; what an earlier merge left under these names is replaced.
    """
    table, data = folder / "merged.nc", folder / "merged.json"
    merged.table.to_netcdf(table, engine="h5netcdf")
    data.write_text(json.dumps(as_json(merged), indent=2, ensure_ascii=False) + "\n")
    rows = row_means(merged.table)
    made = [table, data, write_picture(merged, folder / "merged.png")]
    if not rows:
        return made
    text = folder / "merged_rows.csv"
    with text.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return [*made, text]


def row_means(table: xarray.Dataset) -> list[dict[str, Any]]:
    """Mean and standard deviation of every channel over each row's measured window.

    The last attempt at a row counts. A window that a record does not cover whole gives NaN.
    """
    if "plan.row" not in table:
        return []
    row, phase = table["plan.row"].values, table["plan.phase"].values
    attempt = table["plan.attempt"].values
    names = [str(name) for name in table.data_vars if not str(name).startswith("plan.")]
    found = []
    for one in np.unique(row[(phase == Phase.MEASURE) & (row >= 0)]).tolist():
        inside = (row == one) & (phase == Phase.MEASURE)
        inside &= attempt == attempt[inside].max()
        line: dict[str, Any] = {"row": one, "samples": int(inside.sum())}
        for name in names:
            values = table[name].values[inside]
            unit = table[name].attrs["units"]
            line[f"{name} mean [{unit}]"] = float(values.mean())
            line[f"{name} deviation [{unit}]"] = float(values.std())
        found.append(line)
    return found


def write_picture(merged: Merged, path: Path) -> Path:
    """Each file's lags against the fitted clock, by sine or twin, and where its trigger stands."""
    count = len(merged.sources)
    figure, body = picture.framed_figure(
        10.0,
        2.6 * count + 0.2,
        f"Clocks of merged records: {picture.campaign_name(merged.table.attrs)}",
        merged.table.attrs,
        "",
        "what the fit of offset and drift leaves; run less recorder",
        "; ".join(merged.alarms),
    )
    panels: Any = np.atleast_1d(body.subplots(count, 1))
    for axes, source, record, one in zip(
        panels, merged.sources, merged.records, merged.alignments, strict=True
    ):
        _residuals(axes, record, one)
        axes.set_title(f"{source.name}:  {in_words(one)}", fontsize=8.5, loc="left")
    panels[-1].set_xlabel("recorder's time, s", fontsize=8)
    return picture.save(figure, path)


def _residuals(axes: Axes, record: Recording, one: Alignment) -> None:
    if len(one.cycles):
        width = min(_SMOOTH, len(one.cycles))
        even = np.full(width, 1.0 / width)
        middle = np.convolve(one.cycles, even, "valid")
        smooth = _shown(one, middle, np.convolve(one.residual, even, "valid"))
        size = 3.0 if len(one.cycles) < 300 else 1.5
        every = _shown(one, one.cycles, one.residual)
        axes.plot(one.cycles, every, ".", ms=size, color=LINE, alpha=0.45, label="each lag")
        axes.plot(middle, smooth, color=LINE, lw=1.2, label=f"mean of {width}")
    else:
        axes.text(0.5, 0.2, "no sine: one moment is known, and no drift", fontsize=8, ha="center",
                  color=picture.MUTED, transform=axes.transAxes)  # fmt: skip
    if one.edge_at is not None and one.edge_less_fit is not None:
        bar = 1e3 * DISAGREE
        axes.errorbar(
            one.edge_at, 1e3 * one.edge_less_fit, yerr=bar,
            fmt="D", ms=4, color=EDGE, lw=1.0, capsize=3,
            label=f"trigger ± {bar:g} ms, beyond which there is an alarm",
        )  # fmt: skip
    axes.axhline(0.0, color=picture.FRAME, lw=0.8, zorder=0)
    axes.set_xlim(record.time[0], record.time[-1])
    axes.set_ylabel("ms", fontsize=8)
    if axes.get_legend_handles_labels()[1]:
        axes.legend(loc="upper right", ncols=3, frameon=False, fontsize=7)
    axes.margins(y=0.3)
    picture.style_axes(axes)


def _shown(one: Alignment, time: Any, left: Any) -> Any:
    """Residuals (s) in ms, a slip left in them so that it can be seen."""
    return 1e3 * (left + np.where(time >= one.clock.slip_at, one.clock.slip, 0.0))
