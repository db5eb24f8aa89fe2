"""Export a run as NetCDF for xarray and MHKiT, or as CSV: log fields over time, with units.

At a rate below the run's, a power (unit W) is the mean over the sample's interval, which begins at
its time, so that means and energies stay those of the run. All else is the value at the time: a
position or an angle is read as that, an angle that wraps has no mean, and labels and settings are
values that occurred.
"""

import fnmatch
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
import xarray

from rig.interop.export_size import ExportSize, packed_size, text_size
from rig.recording.runs import RunError, open_run, reader, run_info
from rig.recording.runs.windows import find_incomplete_windows
from rig.recording.table_file import write_table
from rig.regular_file import replacing

INCOMPLETE_FIELD = "record.incomplete"
"""Field that is 1 in measured windows with missing ticks; absent if no window misses ticks."""
INCOMPLETE_ATTRIBUTE = "record_incomplete_rows"
"""Attribute with the missing ticks of each of these windows."""
CSV_RATE = 100.0
"""Hz, greatest rate of a CSV unless a person chooses another: a wave of 1 s has 100 samples."""

_AVERAGED_UNIT = "W"
_VARIABLE_BYTES = 4000  # of HDF5 for a variable, besides its values
_PIECE = 65536  # numbers that are converted to text at a time


class KindFormat(Protocol):
    """A format of `rig export` of one kind of rig.

    ``rate`` is in Hz (None: that of the format); ``for_scripts`` adds the signals that the scripts
    of the test look for. Both functions raise RunError for a run whose fields or rate do not suit.
    """

    def size(self, run: Path, rate: float | None, *, for_scripts: bool) -> ExportSize:
        """Return the estimated size of the file."""

    def write(
        self, run: Path, rate: float | None, path: Path, *, for_scripts: bool
    ) -> tuple[str, ...]:
        """Write a run into a file; return remarks on what does not fit into it."""


class TableSelection(NamedTuple):
    """The part of a run's log that a table has."""

    run: Path
    source: reader.RunFiles
    fields: list[str]
    rows: tuple[int, ...]  # campaign rows; empty: all ticks
    run_rate: float  # Hz
    step: int  # ticks per sample
    ticks: int  # at most, of these rows

    @property
    def rate(self) -> float:
        """Samples per second."""
        return self.run_rate / self.step

    @property
    def rate_remark(self) -> str:
        """Description of the samples at a lower rate than the run's; empty at its own."""
        if self.step == 1:
            return ""
        return (
            f"{self.rate:g} of {self.run_rate:g} ticks a second: powers are means over "
            f"{self.step} ticks from the time on, all else is the value at the time"
        )

    @property
    def samples(self) -> int:
        """Number of samples, at most."""
        return -(-self.ticks // self.step)

    def csv_size(self) -> ExportSize:
        """Return the size of the table as CSV."""
        return text_size(self.source, self.fields, self.samples)

    def netcdf_size(self) -> ExportSize:
        """Return the size of the table as NetCDF."""
        size = packed_size(self.source, self.fields, self.samples)
        return size._replace(bytes=size.bytes + _VARIABLE_BYTES * size.fields)


def csv_fields(run: Path) -> list[str]:
    """Return the default fields of a CSV; all fields would be 150 columns.

    They are motion and force of the measured axis, loads, sensors, power and waves, as far as the
    run has them.
    """
    source = reader.open_files(run)
    axis = run_info(run, source.contents).row_contents.axis
    patterns = (
        *("plan.row", "plan.phase", f"{axis}.estimate.*", f"{axis}.command.force", "load.*"),
        *("*.value", "power.*", "wave.elevation", "probes.*"),
    )
    names = [leaf.name for leaf in source.leaves]
    return [name for name in names if any(fnmatch.fnmatch(name, each) for each in patterns)]


def select_table(
    run: Path,
    fields: Sequence[str],
    rows: Sequence[int],
    rate: float | None = None,
    max_rate: float | None = None,
) -> TableSelection:
    """Return the selection of log fields (all if none are named), of some rows.

    ``rate`` (Hz) None: every tick, or the greatest rate up to ``max_rate`` that divides the run's.
    Raises KeyError for a missing field or row, RunError for a rate that does not divide the run's.
    """
    source = reader.open_files(run)
    names = ["time", *(n for n in reader.select_fields(source.leaves, fields or None))]
    run_rate = _measure_rate(source)
    step = 1
    if rate is not None:
        step = ticks_per_sample(run, run_rate, rate)
    elif max_rate is not None:
        step = max(1, int(np.ceil(run_rate / max_rate - 1e-6)))
    ticks = source.max_rows
    if rows:
        ticks = len(reader.columns(source, [reader.ROW_FIELD], rows)[reader.ROW_FIELD])
    unique = list(dict.fromkeys(names))
    return TableSelection(run, source, unique, tuple(rows), run_rate, step, ticks)


def run_rate(run: Path) -> float:
    """Return the rate of a run, Hz."""
    return _measure_rate(reader.open_files(run))


def _measure_rate(source: reader.RunFiles) -> float:
    """Return the ticks per second at the start of the record, Hz; 1 for less than two ticks."""
    time = next((block["time"] for block in reader.blocks(source)), np.zeros(0))
    return 1.0 / float(np.median(np.diff(time))) if len(time) > 1 else 1.0


def read_table(selection: TableSelection) -> xarray.Dataset:
    """Return the selected part of a run at its rate.

    A sample has the powers' mean over its interval, all else at its time; the attribute
    `cell_methods` of each variable states it as the CF conventions do. If the record lacks ticks of
    measured windows, the dataset has the field `INCOMPLETE_FIELD` and the attribute
    `INCOMPLETE_ATTRIBUTE`.
    """
    run, step = selection.run, selection.step
    dataset = open_run(run, selection.fields, selection.rows or None)
    gaps = find_incomplete_windows(run)
    if gaps.messages:
        marks = gaps.mask(dataset["time"].values)
        dataset[INCOMPLETE_FIELD] = (
            "time",
            marks,
            {"units": "flag", "long_name": "window lacks ticks"},
        )
        dataset.attrs[INCOMPLETE_ATTRIBUTE] = "; ".join(gaps.messages)
    time = dataset["time"].values
    if step == 1 or not len(time):
        return dataset
    tick = np.rint((time - time[0]) * selection.run_rate).astype(np.int64)
    begin = np.flatnonzero(tick % step == 0)
    end = np.searchsorted(tick, tick[begin] + step)
    reduced = dataset.isel(time=begin)
    for name, variable in dataset.data_vars.items():
        averaged = variable.attrs["units"] == _AVERAGED_UNIT
        if averaged:
            reduced[name].values = _interval_means(variable.values, begin, end)
        interval = f"mean (interval: {step / selection.run_rate:g} s)" if averaged else "point"
        reduced[name].attrs["cell_methods"] = f"time: {interval}"
    return reduced


def _interval_means(values: Any, begin: Any, end: Any) -> Any:
    """Return the means of ``values`` over index ranges that do not overlap, none of them empty."""
    edges = np.stack([begin, end], axis=1).ravel()
    sums = np.add.reduceat(np.append(values, 0.0), edges)[::2]
    return sums / (end - begin)


def ticks_per_sample(run: Path, run_rate: float, rate: float) -> int:
    """Return the number of ticks per sample at ``rate`` (Hz).

    Raises RunError if it does not divide ``run_rate`` (Hz).
    """
    step = round(run_rate / rate)
    if step < 1 or abs(run_rate / step - rate) > 1e-6 * rate:
        allowed = ", ".join(f"{run_rate / n:g}" for n in (1, 2, 5, 10, 20))
        raise RunError(
            f"{run}: {rate:g} Hz does not divide its {run_rate:g} Hz; allowed {allowed}, ..."
        )
    return step


def write_netcdf(dataset: xarray.Dataset, path: Path) -> Path:
    """Write NetCDF 4: variables by dotted path with `units`, facts of the run as attributes."""
    encoding = {str(name): {"zlib": True, "complevel": 1} for name in dataset.data_vars}
    with replacing(path) as part:
        # In memory first: HDF5 crashes the process if its disk is full.
        part.write_bytes(dataset.to_netcdf(engine="h5netcdf", encoding=encoding))
    return path


def write_csv(dataset: xarray.Dataset, path: Path) -> Path:
    """Write CSV with a header `name [unit]`, `time` first; numbers read back exactly."""
    names = ["time", *(str(name) for name in dataset.data_vars)]
    columns = {
        f"{name} [{dataset[name].attrs['units']}]": _numbers(dataset[name].values) for name in names
    }
    with replacing(path) as part:
        write_table(columns, part, "\n")
    return path


def _numbers(values: Any) -> Iterator[float]:
    """Yield the numbers of an array, piece by piece: a list of all would be four times as large."""
    for begin in range(0, len(values), _PIECE):
        yield from values[begin : begin + _PIECE].tolist()
