"""A run as NetCDF for xarray and MHKiT, or as CSV: log fields over time, units beside them."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray

from rig.analysis.windows import find_incomplete_windows
from rig.recording.runs import RunError, open_run

CSV_FIELDS = (
    *("plan.row", "plan.phase", "heave.estimate", "heave.command.force", "load", "power.*"),
    *("wave.elevation", "probes"),
)
"""What stands in a CSV unless fields are named: all of a row would be 150 columns."""

MARK = "record.incomplete"
"""1 in ticks of a measured window of which the record lacks ticks; absent if no window does."""
LACKING = "record_incomplete_rows"
"""Attribute with what the record lacks of each."""


def table(
    run: Path, fields: Sequence[str], rows: Sequence[int], rate: float | None
) -> xarray.Dataset:
    """Log fields (all, if none are named) of a run, of some rows, every n-th tick at ``rate`` (Hz).

    If the record lacks ticks of measured windows, `MARK` and `LACKING` say of which.
    KeyError for a field or row that is not there, RunError for a rate that does not divide the
    run's.
    """
    found = open_run(run, fields or None, rows or None)
    lacking = find_incomplete_windows(run)
    if lacking.messages:
        marks = lacking.mask(found["time"].values)
        found[MARK] = ("time", marks, {"units": "flag", "long_name": "window lacks ticks"})
        found.attrs[LACKING] = "; ".join(lacking.messages)
    if rate is None or found.sizes["time"] < 2:
        return found
    time = found["time"].values
    own = 1.0 / float(np.median(np.diff(time)))
    step = round(own / rate)
    if step < 1 or abs(own / step - rate) > 1e-6 * rate:
        raise RunError(f"{run}: {rate:g} Hz does not divide its {own:g} Hz")
    tick = np.rint((time - time[0]) * own).astype(np.int64)
    return found.isel(time=np.flatnonzero(tick % step == 0))


def write_netcdf(made: xarray.Dataset, path: Path) -> Path:
    """NetCDF 4: variables by dotted path with `units`, what the run was as attributes."""
    packed = {str(name): {"zlib": True, "complevel": 1} for name in made.data_vars}
    made.to_netcdf(path, engine="h5netcdf", encoding=packed)
    return path


def write_csv(made: xarray.Dataset, path: Path) -> Path:
    """CSV: a header `name [unit]`, `time` first; numbers that read back as they were."""
    names = ["time", *(str(name) for name in made.data_vars)]
    head = ",".join(f"{name} [{made[name].attrs['units']}]" for name in names)
    columns = [made[name].values.tolist() for name in names]
    with path.open("w", encoding="utf-8") as file:
        file.write(head + "\n")
        file.writelines(",".join(map(repr, row)) + "\n" for row in zip(*columns, strict=True))
    return path
