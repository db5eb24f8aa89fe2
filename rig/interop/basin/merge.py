"""Records of other recorders merged into a run: all on the run's time, as products beside it.

The run's own record is never touched. Merging the same files again gives the same bytes.
"""

import hashlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray

from rig.interop.basin.align import Alignment, Reference, Twin, align
from rig.interop.basin.recording import METRES, Floats, Recording, read_recording, refused
from rig.interop.basin.resample import cubic
from rig.interop.basin.sync import Edge, computed, phase_track, rising_edge
from rig.recording.runs import RunError, reader
from rig.recording.runs.folder import run_info
from rig.regular_file import MAX_RECORD_BYTES, read_regular

TTL = ("ttltrigger", "ttl", "trigger")
SINE = ("sinesignal", "syncsine", "sine")
SYNC = "sync.csv"  # in a run's folder: trigger and sine as the run's own side saw them, run time
OWN_CLOCK = "clock"  # in place of a field: a sine that is made from the run's clock
FREQUENCY = 1.0  # Hz, of the common sine

_PLACE = ("time", "plan.row", "plan.phase", "plan.attempt", "plan.wave_clock")


class Source(NamedTuple):
    """A file to be merged, and what a person says of it."""

    name: str  # of its channels in the product
    path: Path
    unit: str | None = None  # of all its channels, as `METRES`; None: kept as they are
    offset: float | None = None  # s, run less recorder, in place of a trigger
    match: tuple[str, str] | None = None  # channel and log field of one quantity, for the sine


class SyncChannels(NamedTuple):
    """What is common to all files."""

    ttl: str | None = None  # channel; None: one of the usual names
    sine: str | None = None
    run_sine: str | None = None  # log field, or `OWN_CLOCK`; None: that of `SYNC`, if it is there
    frequency: float = FREQUENCY
    rate: float | None = None  # Hz of the product; None: of the fastest file, at most the run's


class Merged(NamedTuple):
    """Files on a run's time."""

    table: xarray.Dataset  # over time (s of the run), channels as NAME.CHANNEL
    sources: tuple[Source, ...]
    records: tuple[Recording, ...]
    alignments: tuple[Alignment, ...]

    @property
    def alarms(self) -> list[str]:
        """All that is doubtful, with the file's name."""
        pairs = zip(self.sources, self.alignments, strict=True)
        return [f"{source.name}: {said}" for source, one in pairs for said in one.alarms]


def merge(run: str | os.PathLike[str], sources: Sequence[Source], asked: SyncChannels) -> Merged:
    """Align each file's clock to the run's and bring its channels onto one even time.

    Raises `ConfigError` for a file that cannot be read or aligned, RunError or KeyError for a run
    or field that is not there.
    """
    opened = reader.open_files(run)
    names = [name for name in _PLACE if name in {leaf.name for leaf in opened.leaves}]
    field = None
    if asked.run_sine not in (None, OWN_CLOCK):
        field = _field(opened, str(asked.run_sine))
    twins = {source.name: _field(opened, source.match[1]) for source in sources if source.match}
    extra = [*([field] if field else []), *twins.values()]
    place = reader.columns(opened, list(dict.fromkeys([*names, *extra])))
    if len(place["time"]) < 2:
        raise RunError(f"{run}: no ticks to merge with")
    known = _reference(Path(run), place, asked, field)
    records, alignments = [], []
    for source in sources:
        record = read_recording(source.path)
        ttl, sine = channels(record, asked)
        twin = None
        if source.match:
            if source.match[0] not in record.channels:
                there = ", ".join(record.channels)
                message = f"{source.match[0]!r} is not in the record; allowed {there}"
                raise refused(source.path, 1, source.match[0], message)
            values = np.asarray(place[twins[source.name]], dtype=np.float64)
            twin = Twin(source.match[0], np.asarray(place["time"]), values)
        try:
            alignments.append(align(record, known, ttl, sine, source.offset, twin))
        except ValueError as error:
            raise refused(source.path, 1, source.name, str(error)) from None
        records.append(record)
    own = (len(place["time"]) - 1) / float(place["time"][-1] - place["time"][0])
    rate = asked.rate or min(max(record.rate for record in records), own)
    table = _on_one_time(place, rate, sources, records, alignments, asked)
    table = table.assign_attrs(run_info(run, opened.contents).attributes())
    return Merged(table, tuple(sources), tuple(records), tuple(alignments))


def _field(opened: reader.RunFiles, named: str) -> str:
    """The one log field of a name; KeyError for none, and for several."""
    field, *more = reader.select_fields(opened.leaves, [named])
    if more:
        raise KeyError(f"{named} is {1 + len(more)} fields; name one of them")
    return field


def channels(record: Recording, asked: SyncChannels) -> tuple[str | None, str | None]:
    """Names of the trigger and the sine in a record: those asked for, or the usual ones."""
    found = []
    for named, usual in ((asked.ttl, TTL), (asked.sine, SINE)):
        here = named if named in record.channels else None
        known = {name.lower().replace("_", ""): name for name in record.channels}
        found.append(here or next((known[name] for name in usual if name in known), None))
    return found[0], found[1]


def _reference(
    run: Path, place: dict[str, Any], asked: SyncChannels, field: str | None
) -> Reference:
    """Trigger and sine as the run knows them."""
    time = np.asarray(place["time"], dtype=np.float64)
    edge, sine = _wave_start(time, place.get("plan.wave_clock")), None
    beside = (run if run.is_dir() else run.parent) / SYNC
    if beside.is_file():
        own = read_recording(beside)
        ttl, tone = channels(own, asked)
        edge = rising_edge(own.time, own.channels[ttl]) if ttl else edge
        if tone and asked.run_sine is None:
            sine = phase_track(own.time, own.channels[tone], asked.frequency)
    if asked.run_sine == OWN_CLOCK:
        sine = computed(asked.frequency)
    elif field:
        sine = phase_track(time, np.asarray(place[field], dtype=np.float64), asked.frequency)
        if sine is None:
            raise RunError(f"{run}: {field} holds less than three cycles of a sine")
    return Reference(edge, sine)


def _wave_start(time: Floats, clock: Any) -> Edge | None:
    """When the run told the wave maker to start: the tick itself, no sampling in between."""
    if clock is None:
        return None
    on = np.asarray(clock) >= 0.0
    rises = np.flatnonzero(on[1:] & ~on[:-1]) + 1
    if rises.size == 0:
        return None
    step = float(time[1] - time[0])
    return Edge(float(time[rises[0]]), step / 12.0**0.5, int(rises.size))


def _on_one_time(
    place: dict[str, Any],
    rate: float,
    sources: Sequence[Source],
    records: list[Recording],
    alignments: list[Alignment],
    asked: SyncChannels,
) -> xarray.Dataset:
    start, end = float(place["time"][0]), float(place["time"][-1])
    time = np.arange(np.ceil(start * rate), np.floor(end * rate + 1e-9) + 1.0) / rate
    near = np.clip(np.searchsorted(place["time"], time - 1e-9), 0, len(place["time"]) - 1)
    made: dict[str, Any] = {
        name: ("time", np.asarray(place[name])[near]) for name in _PLACE[1:] if name in place
    }
    for source, record, one in zip(sources, records, alignments, strict=True):
        at = one.clock.from_run(time)
        scale = METRES[source.unit] if source.unit else 1.0
        for name, value in record.channels.items():
            if name in channels(record, asked):
                continue  # they have done their duty, and a cubic through a trigger is no trigger
            units = {"units": "m" if source.unit else "as recorded", "channel": name}
            values = scale * cubic(record.time, value, at)
            made[f"{source.name}.{name}"] = ("time", values, units)
    return xarray.Dataset(made, {"time": ("time", time, {"units": "s"})})


def as_json(merged: Merged) -> list[dict[str, Any]]:
    """Each file's clock as plain data; what is not known is null."""

    def known(value: float | None) -> float | None:
        return float(value) if value is not None and np.isfinite(value) else None

    told = []
    for source, record, one in zip(merged.sources, merged.records, merged.alignments, strict=True):
        clock, ends = one.clock, record.time[[0, -1]]
        told.append(
            {
                "name": source.name,
                "file": source.path.name,
                "sha256": hashlib.sha256(read_regular(source.path, MAX_RECORD_BYTES)).hexdigest(),
                "rate_hz": record.rate,
                "samples": len(record.time),
                "run_time_s": [float(t) for t in clock.to_run(ends)],
                "method": one.method,
                "offset_s": clock.offset,
                "offset_error_s": known(clock.offset_error),
                "at_s": clock.middle,
                "drift_ppm": 1e6 * clock.drift if one.drift_known else None,
                "drift_error_ppm": 1e6 * clock.drift_error if one.drift_known else None,
                "error_at_ends_s": [known(float(e)) for e in clock.error(ends)],
                "by_edge_s": known(one.by_edge),
                "by_correlation_s": known(one.by_correlation),
                "edge_less_fit_s": known(one.edge_less_fit),
                "correlation_less_fit_s": known(one.correlation_less_fit),
                "sine_snr_db": known(one.snr_db),
                "slip_s": clock.slip or None,
                "slip_at_s": known(clock.slip_at),
                "alarms": list(one.alarms),
                "remarks": list(one.remarks),
            }
        )
    return told
