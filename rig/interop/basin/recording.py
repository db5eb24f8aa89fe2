"""Records of another recorder: basin files (`.twe`) and CSV, with the rate their time column has.

A `.twe` file is tab-separated ASCII with CRLF: a header of labelled lines, an empty line, then
the data, whose first row begins with the label `DATA:` and every other with an empty cell; rows
end with a tab. Channels stand under their CHANNEL NAME. The header's ENG UNITS are not to be
relied on (seen shifted by two columns), so whoever reads a file states the unit.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from rig.config.problems import ConfigError, Problem, display_path
from rig.regular_file import MAX_RECORD_BYTES, read_regular

Floats = npt.NDArray[np.float64]

METRES = {"inch": 0.0254, "m": 1.0, "mm": 0.001, "cm": 0.01}

_TIME_NAMES = ("time", "time_s", "elapsedtime", "elapsed time")
_WALL_NAMES = ("utc time", "utctime", "tai time", "taitime", "date")  # other clocks, or words
_ROUND = 1e-3  # of the rate: as near as that to whole Hz, and the recorder means whole Hz


class Recording(NamedTuple):
    """What a recorder wrote, on its own clock."""

    path: Path
    time: Floats  # s, as its time column has them; rising evenly
    channels: dict[str, Floats]  # in the unit of the file
    lines: npt.NDArray[np.int64]  # line of each sample in the file

    @property
    def rate(self) -> float:
        """Samples a second of its own clock."""
        rate = (len(self.time) - 1) / float(self.time[-1] - self.time[0])
        nearest = float(round(rate))
        return nearest if nearest and abs(rate - nearest) < _ROUND * rate else rate


def read_recording(path: Path, wanted: Sequence[str] | None = None) -> Recording:
    """The record of a file: the channels ``wanted``, or all that are numbers on its time.

    A sample of a channel may be NaN. Raises `ConfigError` naming file and line for a file that
    cannot be read, a channel that is not there, and time that does not rise evenly.
    """
    path = Path(path)
    try:
        text = read_regular(path, MAX_RECORD_BYTES).decode("latin-1").removeprefix("\ufeff")
        lines = text.splitlines()
    except OSError as error:
        message = f"cannot read {display_path(path)}: {error.strerror or type(error).__name__}"
        raise refused(path, 1, "", message) from None
    read = _twe if path.suffix.lower() == ".twe" else _csv
    names, rows = read(path, lines)
    return _evenly(_columns(path, names, rows, wanted))


def refused(path: Path, line: int, key: str, message: str) -> ConfigError:
    """One problem of a record; ``line`` from 1."""
    return ConfigError([Problem(display_path(path), line, key, None, message)])


Rows = Iterator[tuple[int, list[str]]]


def _twe(path: Path, lines: list[str]) -> tuple[list[str], Rows]:
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
        raise refused(path, 1, "", "no CHANNEL NAME: and DATA: lines; not a .twe file")
    data = enumerate(lines[first - 1 :], start=first)
    return names, ((number, line.split("\t")[1:]) for number, line in data)


def _csv(path: Path, lines: list[str]) -> tuple[list[str], Rows]:
    whole = enumerate(lines, start=1)
    kept = ((n, line.split(",")) for n, line in whole if line.strip() and line[0] != "#")
    _, names = next(kept, (0, []))
    return [name.strip() for name in names], kept


def _columns(path: Path, names: list[str], rows: Rows, wanted: Sequence[str] | None) -> Recording:
    at_time = next((i for i, name in enumerate(names) if name.lower() in _TIME_NAMES), None)
    if at_time is None:
        raise refused(path, 1, "", "no time column; allowed time_s (.csv) or Time (.twe)")
    there = {
        name: i
        for i, name in enumerate(names)
        if name and i != at_time and name.lower() not in _WALL_NAMES
    }
    for name in wanted or ():
        if name not in there:
            known = ", ".join(there) or "none"
            raise refused(path, 1, name, f"{name!r} is not in the record; allowed {known}")
    kept = {"time": at_time} | {n: i for n, i in there.items() if wanted is None or n in wanted}
    table: list[list[float]] = []
    numbers: list[int] = []
    for number, cells in rows:
        if not any(cell.strip() for cell in cells):
            continue
        try:
            table.append([float(cells[i]) for i in kept.values()])
        except (ValueError, IndexError):
            raise _no_number(path, number, kept, cells) from None
        numbers.append(number)
    if len(table) < 2:
        raise refused(path, 1, "" if wanted is None else wanted[0], "fewer than 2 samples")
    time, *values = np.array(table, dtype=np.float64).T.copy()
    channels = dict(zip(list(kept)[1:], values, strict=True))
    return Recording(path, time, channels, np.array(numbers, dtype=np.int64))


def _no_number(path: Path, line: int, kept: dict[str, int], cells: list[str]) -> ConfigError:
    for name, i in kept.items():
        cell = cells[i] if i < len(cells) else ""
        try:
            float(cell)
        except ValueError:
            return refused(path, line, name, f"{cell.strip()!r} is not a number")
    raise AssertionError("every cell is a number")


def _evenly(found: Recording) -> Recording:
    """The same; refused where the time column does not rise evenly and without holes."""
    steps = np.diff(found.time)
    rate = (len(found.time) - 1) / float(found.time[-1] - found.time[0] or np.nan)
    uneven = np.flatnonzero(~(np.abs(steps * rate - 1.0) < 0.5))
    if uneven.size:
        i = int(uneven[0])
        message = f"the time column jumps by {steps[i]:.6g} s; it must rise evenly, without holes"
        raise refused(found.path, int(found.lines[i + 1]), "time", message)
    return found
