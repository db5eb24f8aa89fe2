"""Read records of other recorders: basin files (`.twe`) and CSV, at the rate of their time column.

A `.twe` file is tab-separated ASCII with CRLF: a header of labelled lines, an empty line, then
the data. The first data row begins with the label `DATA:`, every other one with an empty cell; rows
end with a tab. The line CHANNEL NAME names the columns. The header's ENG UNITS are unreliable (seen
shifted by two columns), so the caller states the unit.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rig.config.problems import ConfigError, Problem, display_path
from rig.regular_file import MAX_RECORD_BYTES, read_regular

Floats = npt.NDArray[np.float64]

METRES_PER_UNIT = {"inch": 0.0254, "m": 1.0, "mm": 0.001, "cm": 0.01}

_TIME_NAMES = ("time", "time_s", "elapsedtime", "elapsed time")
_CLOCK_NAMES = ("utc time", "utctime", "tai time", "taitime", "date")  # other clocks, or text
_RATE_TOLERANCE = 1e-3  # relative; a rate this close to whole Hz is taken as whole


class Recording(NamedTuple):
    """The samples of a recorder on its own clock."""

    path: Path
    time: Floats  # s, from the time column; evenly spaced
    channels: dict[str, Floats]  # by name, in the unit of the file
    lines: npt.NDArray[np.int64]  # line of each sample in the file

    @property
    def rate(self) -> float:
        """Samples per second of the recorder's clock."""
        rate = (len(self.time) - 1) / float(self.time[-1] - self.time[0])
        nearest = float(round(rate))
        return nearest if nearest and abs(rate - nearest) < _RATE_TOLERANCE * rate else rate


def read_recording(path: Path, channels: Sequence[str] | None = None) -> Recording:
    """Read ``channels`` of a file; None reads all columns but time and date.

    A sample may be NaN. Raises `ConfigError` with file and line for a file that cannot be read, a
    missing channel, and a time column that is not evenly spaced.
    """
    path = Path(path)
    try:
        text = read_regular(path, MAX_RECORD_BYTES).decode("latin-1").removeprefix("\ufeff")
        lines = text.splitlines()
    except OSError as error:
        message = f"cannot read {display_path(path)}: {error.strerror or type(error).__name__}"
        raise record_error(path, 1, "", message) from None
    read_rows = _read_twe if path.suffix.lower() == ".twe" else _read_csv
    names, rows = read_rows(path, lines)
    return _check_even(_read_columns(path, names, rows, channels))


def record_error(path: Path, line: int, key: str, message: str) -> ConfigError:
    """Return a `ConfigError` with one problem of a record; ``line`` counts from 1."""
    return ConfigError([Problem(display_path(path), line, key, None, message)])


Rows = Iterator[tuple[int, list[str]]]


def _read_twe(path: Path, lines: list[str]) -> tuple[list[str], Rows]:
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
        raise record_error(path, 1, "", "no CHANNEL NAME: and DATA: lines; not a .twe file")
    data = enumerate(lines[first - 1 :], start=first)
    return names, ((number, line.split("\t")[1:]) for number, line in data)


def _read_csv(path: Path, lines: list[str]) -> tuple[list[str], Rows]:
    numbered = enumerate(lines, start=1)
    rows = ((n, line.split(",")) for n, line in numbered if line.strip() and line[0] != "#")
    _, names = next(rows, (0, []))
    return [name.strip() for name in names], rows


def _read_columns(
    path: Path, names: list[str], rows: Rows, channels: Sequence[str] | None
) -> Recording:
    time_column = next((i for i, name in enumerate(names) if name.lower() in _TIME_NAMES), None)
    if time_column is None:
        raise record_error(path, 1, "", "no time column; allowed time_s (.csv) or Time (.twe)")
    columns = {
        name: i
        for i, name in enumerate(names)
        if name and i != time_column and name.lower() not in _CLOCK_NAMES
    }
    for name in channels or ():
        if name not in columns:
            available = ", ".join(columns) or "none"
            raise record_error(path, 1, name, f"{name!r} is not in the record; allowed {available}")
    selected = {"time": time_column} | {
        n: i for n, i in columns.items() if channels is None or n in channels
    }
    table: list[list[float]] = []
    numbers: list[int] = []
    for number, cells in rows:
        if not any(cell.strip() for cell in cells):
            continue
        try:
            table.append([float(cells[i]) for i in selected.values()])
        except (ValueError, IndexError):
            raise _number_error(path, number, selected, cells) from None
        numbers.append(number)
    if len(table) < 2:
        raise record_error(path, 1, "" if channels is None else channels[0], "fewer than 2 samples")
    time, *values = np.array(table, dtype=np.float64).T.copy()
    values_by_name = dict(zip(list(selected)[1:], values, strict=True))
    return Recording(path, time, values_by_name, np.array(numbers, dtype=np.int64))


def _number_error(path: Path, line: int, selected: dict[str, int], cells: list[str]) -> ConfigError:
    for name, i in selected.items():
        cell = cells[i] if i < len(cells) else ""
        try:
            float(cell)
        except ValueError:
            return record_error(path, line, name, f"{cell.strip()!r} is not a number")
    raise AssertionError("every cell is a number")


def _check_even(recording: Recording) -> Recording:
    """Return the recording; raise `ConfigError` if its time column is uneven or has gaps."""
    steps = np.diff(recording.time)
    rate = (len(recording.time) - 1) / float(recording.time[-1] - recording.time[0] or np.nan)
    uneven = np.flatnonzero(~(np.abs(steps * rate - 1.0) < 0.5))
    if uneven.size:
        i = int(uneven[0])
        message = f"the time column jumps by {steps[i]:.6g} s; it must rise evenly, without gaps"
        raise record_error(recording.path, int(recording.lines[i + 1]), "time", message)
    return recording
