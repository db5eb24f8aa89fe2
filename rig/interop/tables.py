"""Export a run as NetCDF for xarray and MHKiT, or as CSV: log fields over time, with units."""

import fnmatch
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray

from rig.recording.runs import RunError, open_run, reader, run_info
from rig.recording.runs.windows import find_incomplete_windows
from rig.recording.table_file import write_table

INCOMPLETE_FIELD = "record.incomplete"
"""Field that is 1 in measured windows with missing ticks; absent if no window misses ticks."""
INCOMPLETE_ATTRIBUTE = "record_incomplete_rows"
"""Attribute with the missing ticks of each of these windows."""


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


def export_table(
    run: Path, fields: Sequence[str], rows: Sequence[int], rate: float | None
) -> xarray.Dataset:
    """Return log fields of a run (all if none are named), of some rows, at ``rate`` (Hz).

    The function takes every n-th tick. If the record lacks ticks of measured windows, the dataset
    has the field `INCOMPLETE_FIELD` and the attribute `INCOMPLETE_ATTRIBUTE`. Raises KeyError for a
    missing field or row, RunError for a rate that does not divide the run's.
    """
    dataset = open_run(run, fields or None, rows or None)
    gaps = find_incomplete_windows(run)
    if gaps.messages:
        marks = gaps.mask(dataset["time"].values)
        dataset[INCOMPLETE_FIELD] = (
            "time",
            marks,
            {"units": "flag", "long_name": "window lacks ticks"},
        )
        dataset.attrs[INCOMPLETE_ATTRIBUTE] = "; ".join(gaps.messages)
    if rate is None or dataset.sizes["time"] < 2:
        return dataset
    time = dataset["time"].values
    run_rate = 1.0 / float(np.median(np.diff(time)))
    tick = np.rint((time - time[0]) * run_rate).astype(np.int64)
    kept = np.flatnonzero(tick % ticks_per_sample(run, run_rate, rate) == 0)
    return dataset.isel(time=kept)


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
    dataset.to_netcdf(path, engine="h5netcdf", encoding=encoding)
    return path


def write_csv(dataset: xarray.Dataset, path: Path) -> Path:
    """Write CSV with a header `name [unit]`, `time` first; numbers read back exactly."""
    names = ["time", *(str(name) for name in dataset.data_vars)]
    columns = {
        f"{name} [{dataset[name].attrs['units']}]": dataset[name].values.tolist() for name in names
    }
    return write_table(columns, path, "\n")
