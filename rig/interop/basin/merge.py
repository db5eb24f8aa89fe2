"""Merge records of other recorders into a run, resampled to the run's time.

The result is a product in the run's folder; the run's own record is never changed. Merging the same
files again gives the same bytes.
"""

import hashlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray

from rig.interop.basin.align import Alignment, MatchedChannel, SyncReference, align
from rig.interop.basin.sync import Edge, ideal_sine, phase_track, rising_edge
from rig.presentation.json_values import json_value
from rig.recording.channel_file import (
    METRES_PER_UNIT,
    Floats,
    Recording,
    read_recording,
    record_error,
)
from rig.recording.runs import RunError, reader, run_info
from rig.regular_file import MAX_RECORD_BYTES, read_regular

TTL_NAMES = ("ttltrigger", "ttl", "trigger")
SINE_NAMES = ("sinesignal", "syncsine", "sine")
SYNC_FILE = (
    "sync.csv"  # in a run's folder: trigger and sine recorded on the run's side, in run time
)
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
