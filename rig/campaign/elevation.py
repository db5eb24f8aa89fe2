"""Recorded wave elevation: basin files (`.twe`) and CSV.

A `.twe` file is tab-separated ASCII with CRLF: a header of labelled lines, an empty line, then
the data, whose first row begins with the label `DATA:` and every other with an empty cell; rows
end with a tab. Channels stand under their CHANNEL NAME. The header's ENG UNITS are not to be
relied on (seen shifted by two columns), so the campaign file states the unit.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rig.config.problems import ConfigError, Problem, number_text, shown
from rig.config.sea import RecordedSea

METRES = {"inch": 0.0254, "m": 1.0, "mm": 0.001, "cm": 0.01}

_TIME_NAMES = ("time", "time_s", "elapsedtime", "elapsed time")
_RATE_TOLERANCE = 1e-3  # of the rate; time columns are rounded


class Elevation(NamedTuple):
    """Undisturbed wave elevation over the window of a recorded sea."""

    rate_hz: float
    elevation: npt.NDArray[np.float64]  # m, up positive, mean taken out


class _Columns(NamedTuple):
    """Time and one channel as they stand in a file."""

    time: npt.NDArray[np.float64]  # s
    value: npt.NDArray[np.float64]  # in the file's unit
    lines: npt.NDArray[np.int64]  # line of each row


def read_elevation(path: Path, sea: RecordedSea) -> Elevation:
    """Elevation of a recorded sea's channel; raises `ConfigError` naming file and line."""
    rate, value = read_window(path, sea.channel, (sea.start_s, sea.end_s), sea.rate_hz)
    value = value * METRES[sea.unit]
    return Elevation(rate, value - value.mean())


def read_window(
    path: Path, channel: str, window: tuple[float, float], said_hz: float | None
) -> tuple[float, npt.NDArray[np.float64]]:
    """Rate (Hz) and samples of a channel with start <= t < end (s), in the file's own unit.

    The rate is that of the file's time column; ``said_hz`` is what the campaign says it is.
    Raises `ConfigError` naming file and line.
    """
    try:
        lines = path.read_text(encoding="latin-1").removeprefix("\ufeff").splitlines()
    except OSError as error:
        message = f"cannot read {shown(path)}: {error.strerror or type(error).__name__}"
        raise _error(path, 1, "", message) from None
    read = _read_twe if path.suffix.lower() == ".twe" else _read_csv
    columns = read(path, lines, channel)
    rate = _rate(path, columns, said_hz)
    time, (start, end) = columns.time, window
    # Half a sample of grace: a time column is rounded.
    inside = (time >= start - 0.5 / rate) & (time < end - 0.5 / rate)
    value = columns.value[inside]
    wanted = round((end - start) * rate)
    if len(value) != wanted:
        raise _error(
            path,
            1,
            channel,
            f"the window {number_text(start)} .. {number_text(end)} s is not in the "
            f"record; it has {time[0]:.6g} .. {time[-1] + 1.0 / rate:.6g} s",
        )
    return rate, value


def _read_twe(path: Path, lines: list[str], channel: str) -> _Columns:
    names: list[str] = []
    first = 0
    for number, line in enumerate(lines, start=1):
        label, *cells = line.split("\t")
        if label == "CHANNEL NAME:":
            names = [cell.strip() for cell in cells]
        if label == "DATA:":
            first = number
            break
    if not names or not first:
        raise _error(path, 1, "", "no CHANNEL NAME: and DATA: lines; not a .twe file")
    rows = ((n, line.split("\t")[1:]) for n, line in enumerate(lines[first - 1 :], start=first))
    return _columns(path, names, rows, channel)


def _read_csv(path: Path, lines: list[str], channel: str) -> _Columns:
    names: list[str] = []
    rows: list[tuple[int, list[str]]] = []
    for number, line in enumerate(lines, start=1):
        if not line.strip() or line.startswith("#"):
            continue
        if not names:
            names = [cell.strip() for cell in line.split(",")]
        else:
            rows.append((number, line.split(",")))
    return _columns(path, names, iter(rows), channel)


def _columns(
    path: Path, names: list[str], rows: Iterator[tuple[int, list[str]]], channel: str
) -> _Columns:
    at_time = next((i for i, name in enumerate(names) if name.lower() in _TIME_NAMES), None)
    channels = [n for i, n in enumerate(names) if i != at_time and n.lower() != "utc time"]
    if at_time is None:
        raise _error(path, 1, "", "no time column; allowed time_s (.csv) or Time (.twe)")
    if channel not in channels:
        words = ", ".join(channels) or "none"
        raise _error(path, 1, channel, f"{channel!r} is not in the record; allowed {words}")
    at_value = names.index(channel)
    times: list[float] = []
    values: list[float] = []
    numbers: list[int] = []
    for number, cells in rows:
        if not any(cell.strip() for cell in cells):
            continue
        for name, i, column in (("time", at_time, times), (channel, at_value, values)):
            cell = cells[i] if i < len(cells) else ""
            try:
                column.append(float(cell))
            except ValueError:
                raise _error(path, number, name, f"{cell.strip()!r} is not a number") from None
        numbers.append(number)
    if len(times) < 2:
        raise _error(path, 1, channel, "fewer than 2 samples")
    return _Columns(np.array(times), np.array(values), np.array(numbers, dtype=np.int64))


def _rate(path: Path, columns: _Columns, said: float | None) -> float:
    """Sampling rate, Hz, of an even time column without holes."""
    steps = np.diff(columns.time)
    rate = (len(columns.time) - 1) / float(columns.time[-1] - columns.time[0] or np.nan)
    uneven = np.flatnonzero(~(np.abs(steps * rate - 1.0) < 0.5))
    if uneven.size:
        i = int(uneven[0])
        line = int(columns.lines[i + 1])
        message = f"the time column jumps by {steps[i]:.6g} s; it must rise evenly, without holes"
        raise _error(path, line, "time", message)
    bad = np.flatnonzero(~np.isfinite(columns.value))
    if bad.size:
        raise _error(path, int(columns.lines[bad[0]]), "", "a sample that is not a finite number")
    if said is not None and abs(said - rate) > _RATE_TOLERANCE * rate:
        message = f"the campaign says {number_text(said)} Hz, the time column {rate:.6g} Hz"
        raise _error(path, 1, "rate_hz", message)
    nearest = float(round(rate))
    return nearest if nearest and abs(rate - nearest) < _RATE_TOLERANCE * rate else rate


def _error(path: Path, line: int, key: str, message: str) -> ConfigError:
    return ConfigError([Problem(shown(path), line, key, None, message)])
