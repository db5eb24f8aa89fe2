"""Relations between runs of a test log, and the recorded values of calibrated quantities in it."""

from collections.abc import Iterable
from datetime import date
from typing import NamedTuple, TypeVar

from rig.interop.legacy.testlog.entry import Activity, Bias, Entry
from rig.interop.legacy.testlog.read import RunLog
from rig.recording.calibration import RecordingTime
from rig.recording.calibration_changes import RecordedValue

K = TypeVar("K")
V = TypeVar("V")


class Repeat(NamedTuple):
    """Runs of one gain matrix, and the other settings that differ between them."""

    matrix: str
    runs: tuple[int, ...]
    differences: tuple[str, ...]  # of waves, drive, scheme, surge; empty for a plain repetition


class Links(NamedTuple):
    """Runs that belong together, by relation."""

    wave_series: dict[int, tuple[int, ...]]  # wave series -> runs
    unnamed_series: tuple[int, ...]  # numbers between first and last that no run has
    shared_files: dict[str, tuple[int, ...]]  # file -> runs
    matrices: dict[str, tuple[int, ...]]  # gain matrix -> runs
    repeats: tuple[Repeat, ...]  # of gain matrices that more than one run used
    biases: tuple[tuple[int, Bias], ...]  # run, and action on the heave position's zero


_COMPARED = ("waves", "drive", "scheme", "surge")


def find_links(log: RunLog) -> Links:
    """Return the relations between the runs of a log."""
    entries = log.entries
    series = _group((number, entry.run) for entry in entries for number in entry.wave_series)
    files = _group((entry.file, entry.run) for entry in entries if entry.file)
    matrices = _group((entry.matrix, entry) for entry in entries if entry.matrix)
    numbers = sorted(series)
    span = range(numbers[0], numbers[-1]) if numbers else range(0)
    return Links(
        wave_series={number: series[number] for number in numbers},
        unnamed_series=tuple(number for number in span if number not in series),
        shared_files={name: runs for name, runs in files.items() if len(runs) > 1},
        matrices={name: tuple(e.run for e in group) for name, group in matrices.items()},
        repeats=tuple(
            Repeat(
                name,
                tuple(entry.run for entry in group),
                tuple(f for f in _COMPARED if len({getattr(entry, f) for entry in group}) > 1),
            )
            for name, group in matrices.items()
            if len(group) > 1
        ),
        biases=tuple((entry.run, bias) for entry in entries for bias in entry.biases),
    )


def _group(pairs: Iterable[tuple[K, V]]) -> dict[K, tuple[V, ...]]:
    groups: dict[K, tuple[V, ...]] = {}
    for key, value in pairs:
        groups[key] = (*groups.get(key, ()), value)
    return groups


_PRODUCTS = {
    Activity.GAIN_MATRIX: ("row table", "power surfaces"),
    Activity.GAINS: ("row table",),
    Activity.BY_HAND: ("row table",),
    Activity.MULTISINE: ("identified impedance",),
}


def values_in_log(log: RunLog, quantity: str) -> tuple[RecordedValue, ...]:
    """Return every record of a quantity in a log, and every gain matrix that contains it."""
    if quantity != "spring_rate":
        return ()
    return tuple(value for entry in log.entries if (value := _of_entry(entry)) is not None)


def recording_time(entry: Entry) -> RecordingTime:
    """Return the time of an entry's run, by its number and the date in its file's name."""
    day = date.fromisoformat(entry.recorded[:10]) if entry.recorded else None
    return RecordingTime(entry.series_name, entry.run, day)


def _of_entry(entry: Entry) -> RecordedValue | None:
    products = [name for a in entry.activities for name in _PRODUCTS.get(a, ())]
    rests = tuple(dict.fromkeys(products))
    if entry.spring is not None:
        value = entry.spring.written_n_per_m
        return RecordedValue(entry.name, entry.spring.cell, recording_time(entry), value, "", rests)
    if not entry.matrix:
        return None
    note = f"spring rates stand in {entry.matrix}, not in the log"
    return RecordedValue(entry.name, f"row {entry.row}", recording_time(entry), None, note, rests)
