"""Merge records of other recorders into a run, resampled to the run's time.

The result is a product in the run's folder; the run's own record is never changed. Merging the same
files again gives the same bytes.
"""

import hashlib
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray
from matplotlib.axes import Axes

from rig.interop.basin.align import (
    MAX_EDGE_DIFFERENCE,
    Alignment,
    Edge,
    MatchedChannel,
    SyncReference,
    align,
    format_alignment,
    ideal_sine,
    phase_track,
    rising_edge,
)
from rig.presentation import picture
from rig.presentation.json_values import json_value
from rig.realtime.sequence import Phase
from rig.recording.channel_file import (
    METRES_PER_UNIT,
    Floats,
    Recording,
    read_recording,
    record_error,
)
from rig.recording.runs import RunError, reader, run_info
from rig.recording.table_file import write_table
from rig.regular_file import MAX_RECORD_BYTES, read_regular

TTL_NAMES = ("ttltrigger", "ttl", "trigger")
SINE_NAMES = ("sinesignal", "syncsine", "sine")
# In a run's folder: trigger and sine recorded on the run's side, in run time.
SYNC_FILE = "sync.csv"
RUN_CLOCK = "clock"  # instead of a log field: a sine that was generated from the run's clock
SINE_FREQUENCY = 1.0  # Hz, of the common sine

_PLAN_FIELDS = ("time", "plan.row", "plan.phase", "plan.attempt", "plan.wave_clock")


class MergeSource(NamedTuple):
    """A file to be merged, and its settings from the command line."""

    name: str  # prefix of its channels in the product
    path: Path
    unit: str | None = None  # of all its channels: a key of `METRES_PER_UNIT`; None: as recorded
    offset: float | None = None  # s, run minus recorder, replaces the trigger
    match: tuple[str, str] | None = None  # channel and log field of one quantity; replaces the sine


class SyncChannels(NamedTuple):
    """Trigger, sine and rate that all files have in common."""

    ttl: str | None = None  # channel; None: a name of `TTL_NAMES`
    sine: str | None = None  # channel; None: a name of `SINE_NAMES`
    run_sine: str | None = None  # log field, or `RUN_CLOCK`; None: `SYNC_FILE`, if it exists
    frequency: float = SINE_FREQUENCY
    rate: float | None = None  # Hz of the product; None: the fastest file's, at most the run's


class AlignedRecord(NamedTuple):
    """A record and its alignment to the run's clock."""

    source: MergeSource
    recording: Recording
    alignment: Alignment


class MergedRecords(NamedTuple):
    """Records resampled to a run's time."""

    table: xarray.Dataset  # over time (s of the run), channels as NAME.CHANNEL
    records: tuple[AlignedRecord, ...]

    @property
    def alarms(self) -> list[str]:
        """All alarms of the alignments, each with the name of its source."""
        return [
            f"{record.source.name}: {alarm}"
            for record in self.records
            for alarm in record.alignment.alarms
        ]


def merge(
    run: str | os.PathLike[str], sources: Sequence[MergeSource], sync: SyncChannels
) -> MergedRecords:
    """Align each file's clock to the run's and resample its channels to one even time.

    Raises `ConfigError` for a file that cannot be read or aligned, RunError or KeyError for a
    missing run or field.
    """
    log = reader.open_files(run)
    names = [name for name in _PLAN_FIELDS if name in {leaf.name for leaf in log.leaves}]
    field = None
    if sync.run_sine not in (None, RUN_CLOCK):
        field = _field(log, str(sync.run_sine))
    match_fields = {source.name: _field(log, source.match[1]) for source in sources if source.match}
    extra = [*([field] if field else []), *match_fields.values()]
    log_columns = reader.columns(log, list(dict.fromkeys([*names, *extra])))
    if len(log_columns["time"]) < 2:
        raise RunError(f"{run}: no ticks to merge with")
    reference = _sync_reference(Path(run), log_columns, sync, field)
    time = np.asarray(log_columns["time"])
    records = []
    for source in sources:
        recording = read_recording(source.path)
        ttl, sine = find_sync_channels(recording, sync)
        match = None
        if source.match:
            channel = source.match[0]
            if channel not in recording.channels:
                message = (
                    f"{channel!r} is not in the record; allowed {', '.join(recording.channels)}"
                )
                raise record_error(source.path, 1, channel, message)
            values = np.asarray(log_columns[match_fields[source.name]], dtype=np.float64)
            match = MatchedChannel(channel, time, values)
        try:
            alignment = align(recording, reference, ttl, sine, source.offset, match)
        except ValueError as error:
            raise record_error(source.path, 1, source.name, str(error)) from None
        records.append(AlignedRecord(source, recording, alignment))
    run_rate = (len(time) - 1) / float(time[-1] - time[0])
    rate = sync.rate or min(max(record.recording.rate for record in records), run_rate)
    table = _merge_channels(log_columns, rate, records, sync)
    table = table.assign_attrs(run_info(run, log.contents).attributes())
    return MergedRecords(table, tuple(records))


def _field(log: reader.RunFiles, name: str) -> str:
    """Return the log field of a name; raise KeyError for no field and for several."""
    field, *more = reader.select_fields(log.leaves, [name])
    if more:
        raise KeyError(f"{name} is {1 + len(more)} fields; name one of them")
    return field


def find_sync_channels(record: Recording, sync: SyncChannels) -> tuple[str | None, str | None]:
    """Return the names of trigger and sine in a record; None for each that it lacks.

    The names in ``sync`` come first, then `TTL_NAMES` and `SINE_NAMES`.
    """
    by_plain_name = {name.lower().replace("_", ""): name for name in record.channels}

    def find(requested: str | None, usual_names: tuple[str, ...]) -> str | None:
        if requested in record.channels:
            return requested
        return next((by_plain_name[name] for name in usual_names if name in by_plain_name), None)

    return find(sync.ttl, TTL_NAMES), find(sync.sine, SINE_NAMES)


def _sync_reference(
    run: Path, log_columns: dict[str, Any], sync: SyncChannels, field: str | None
) -> SyncReference:
    """Return trigger and sine as the run recorded them."""
    time = np.asarray(log_columns["time"], dtype=np.float64)
    edge, sine = _wave_start(time, log_columns.get("plan.wave_clock")), None
    path = (run if run.is_dir() else run.parent) / SYNC_FILE
    if path.is_file():
        recording = read_recording(path)
        ttl, tone = find_sync_channels(recording, sync)
        edge = rising_edge(recording.time, recording.channels[ttl]) if ttl else edge
        if tone and sync.run_sine is None:
            sine = phase_track(recording.time, recording.channels[tone], sync.frequency)
    if sync.run_sine == RUN_CLOCK:
        sine = ideal_sine(sync.frequency)
    elif field:
        sine = phase_track(time, np.asarray(log_columns[field], dtype=np.float64), sync.frequency)
        if sine is None:
            raise RunError(f"{run}: {field} holds fewer than three cycles of a sine")
    return SyncReference(edge, sine)


def _wave_start(time: Floats, clock: Any) -> Edge | None:
    """Return the edge at which the run started the wave maker; its time is that of the tick."""
    if clock is None:
        return None
    on = np.asarray(clock) >= 0.0
    rises = np.flatnonzero(on[1:] & ~on[:-1]) + 1
    if rises.size == 0:
        return None
    step = float(time[1] - time[0])
    return Edge(float(time[rises[0]]), step / 12.0**0.5, int(rises.size))


def _merge_channels(
    log_columns: dict[str, Any], rate: float, records: list[AlignedRecord], sync: SyncChannels
) -> xarray.Dataset:
    log_time = log_columns["time"]
    start, end = float(log_time[0]), float(log_time[-1])
    time = np.arange(np.ceil(start * rate), np.floor(end * rate + 1e-9) + 1.0) / rate
    nearest = np.clip(np.searchsorted(log_time, time - 1e-9), 0, len(log_time) - 1)
    variables: dict[str, Any] = {
        name: ("time", np.asarray(log_columns[name])[nearest])
        for name in _PLAN_FIELDS[1:]
        if name in log_columns
    }
    for source, recording, alignment in records:
        record_time = alignment.clock.from_run(time)
        scale = METRES_PER_UNIT[source.unit] if source.unit else 1.0
        sync_channels = find_sync_channels(recording, sync)
        for name, value in recording.channels.items():
            if name in sync_channels:
                continue  # only needed for the alignment; a cubic through a trigger would overshoot
            units = {"units": "m" if source.unit else "as recorded", "channel": name}
            values = scale * interpolate_cubic(recording.time, value, record_time)
            variables[f"{source.name}.{name}"] = ("time", values, units)
    return xarray.Dataset(variables, {"time": ("time", time, {"units": "s"})})


def interpolate_cubic(time: Floats, value: Floats, at: Floats) -> Floats:
    """Return ``value`` at times ``at`` by the cubic through the four nearest samples; NaN outside.

    ``time`` must be evenly spaced. The error for a 1 Hz wave sampled at 50 Hz is 6e-6 of its
    amplitude; linear interpolation would give 2e-3. A NaN sample affects only results within two
    samples of it.
    """
    count = len(time)
    rate = (count - 1) / float(time[-1] - time[0])
    position = (at - time[0]) * rate
    inside = (position >= -1e-6) & (position <= count - 1 + 1e-6)
    if count < 4:
        return np.where(inside, np.interp(at, time, value), np.nan)
    first = np.clip(np.floor(np.where(inside, position, 0.0)).astype(np.int64) - 1, 0, count - 4)
    x: Any = position - first  # 1 .. 2 except at the ends
    a, b, c, d = (value[first + i] for i in range(4))
    result = (
        -a * (x - 1.0) * (x - 2.0) * (x - 3.0) / 6.0
        + b * x * (x - 2.0) * (x - 3.0) / 2.0
        - c * x * (x - 1.0) * (x - 3.0) / 2.0
        + d * x * (x - 1.0) * (x - 2.0) / 6.0
    )
    return np.asarray(np.where(inside, result, np.nan), dtype=np.float64)


def to_json(merged: MergedRecords) -> list[dict[str, Any]]:
    """Return each file's clock as JSON values; unknown numbers are null."""
    entries = []
    for source, recording, alignment in merged.records:
        clock, lags, ends = alignment.clock, alignment.lags, recording.time[[0, -1]]
        entries.append(
            {
                "name": source.name,
                "file": source.path.name,
                "sha256": hashlib.sha256(read_regular(source.path, MAX_RECORD_BYTES)).hexdigest(),
                "rate_hz": recording.rate,
                "samples": len(recording.time),
                "run_time_s": clock.to_run(ends).tolist(),
                "method": alignment.method,
                "offset_s": clock.offset,
                "offset_error_s": clock.offset_error,
                "at_s": clock.middle,
                "drift_ppm": 1e6 * clock.drift if lags else None,
                "drift_error_ppm": 1e6 * clock.drift_error if lags else None,
                "error_at_ends_s": clock.error(ends).tolist(),
                "by_edge_s": alignment.edge_offset,
                "by_correlation_s": lags and lags.correlation_offset,
                "edge_less_fit_s": alignment.edge_residual,
                "correlation_less_fit_s": alignment.correlation_residual,
                "sine_snr_db": lags and lags.snr_db,
                "slip_s": clock.slip or None,
                "slip_at_s": clock.slip_at,
                "alarms": alignment.alarms,
                "remarks": alignment.remarks,
            }
        )
    values: list[dict[str, Any]] = json_value(entries)
    return values


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
    columns = {key: [row[key] for row in rows] for key in rows[0]}
    return [*written, write_table(columns, folder / "merged_rows.csv")]


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
