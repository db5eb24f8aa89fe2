"""Relations between runs of a test log: wave series, shared files, repeated gain matrices."""

from collections.abc import Iterable
from typing import NamedTuple, TypeVar

from rig.interop.legacy.testlog.entry import Bias
from rig.interop.legacy.testlog.read import RunLog

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
