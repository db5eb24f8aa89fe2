"""Relations between runs of a test log: wave series, shared files, repeated gain matrices."""

from collections.abc import Callable
from typing import NamedTuple

from rig.interop.legacy.testlog.entry import Bias, Entry
from rig.interop.legacy.testlog.read import RunLog


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


_COMPARED: tuple[tuple[str, Callable[[Entry], object]], ...] = (
    ("waves", lambda entry: entry.waves),
    ("drive", lambda entry: entry.drive),
    ("scheme", lambda entry: entry.scheme),
    ("surge", lambda entry: entry.surge),
)


def find_links(log: RunLog) -> Links:
    """Return the relations between the runs of a log."""
    series: dict[int, list[int]] = {}
    files: dict[str, list[int]] = {}
    matrices: dict[str, list[Entry]] = {}
    for entry in log.entries:
        for number in entry.wave_series:
            series.setdefault(number, []).append(entry.run)
        if entry.file:
            files.setdefault(entry.file, []).append(entry.run)
        if entry.matrix:
            matrices.setdefault(entry.matrix, []).append(entry)
    numbers = sorted(series)
    span = range(numbers[0], numbers[-1]) if numbers else range(0)
    return Links(
        wave_series={number: tuple(series[number]) for number in numbers},
        unnamed_series=tuple(number for number in span if number not in series),
        shared_files={name: tuple(runs) for name, runs in files.items() if len(runs) > 1},
        matrices={name: tuple(e.run for e in group) for name, group in matrices.items()},
        repeats=tuple(
            Repeat(name, tuple(e.run for e in group), _differences(group))
            for name, group in matrices.items()
            if len(group) > 1
        ),
        biases=tuple((entry.run, bias) for entry in log.entries for bias in entry.biases),
    )


def _differences(entries: list[Entry]) -> tuple[str, ...]:
    return tuple(
        name
        for name, value_of in _COMPARED
        if any(value_of(entry) != value_of(entries[0]) for entry in entries)
    )
