"""The row table of a run: read from its ``rows.nc`` where that is current, else computed.

A table depends on the record, the recorded plan and configuration, the status of the run, and the
code that computes it. A stored table names all of these as they were, and is current where they are
the same now. Calibrations change a table, so theirs is always computed; so is that of a run in
progress, and every table by code with local changes.
"""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rig.analysis.rows import row_table
from rig.recording import provenance
from rig.recording.calibration import CalibrationVersion
from rig.recording.runs.folder import CONFIG, PLAN, STATUS, mcap_files
from rig.recording.runs.state import read_json

if TYPE_CHECKING:
    import xarray

ROWS = "rows.nc"
COMPUTED_FROM, ORDER = "computed_from", "variable_order"  # attributes of a table
_STATUS_KEYS = ("status", "ended_utc", "recovered_utc", "resumed_utc", "record")


def current_table(
    run: str | os.PathLike[str],
    calibrations: Sequence[CalibrationVersion] = (),
    *,
    incomplete_rows: bool = False,
) -> "xarray.Dataset":
    """Return the row table of a run; arguments and errors are those of `row_table`."""
    folder = Path(run)
    if calibrations or incomplete_rows or not folder.is_dir():
        return row_table(run, calibrations, incomplete_rows=incomplete_rows)
    source = _source(folder)
    if not source:
        return row_table(run)
    stored = _read(folder / ROWS)
    if stored is not None and stored.attrs.get(COMPUTED_FROM) == source:
        return stored
    table = row_table(run)
    return table.assign_attrs({COMPUTED_FROM: source, ORDER: json.dumps([*table.variables])})


def _source(folder: Path) -> str:
    """Return all on which a table depends as text; empty if no table can be kept."""
    status, code = read_json(folder / STATUS), provenance.describe_code()
    if status.get("status", "running") == "running" or code["dirty"]:
        return ""
    files = [*mcap_files(folder), *(folder / name for name in (CONFIG, PLAN))]
    stats = {each.name: each.stat() for each in files if each.is_file()}
    return json.dumps(
        {
            "code": code,
            "status": {key: status.get(key) for key in _STATUS_KEYS},
            "files": {name: [stat.st_size, stat.st_mtime_ns] for name, stat in stats.items()},
        }
    )


def _read(path: Path) -> "xarray.Dataset | None":
    """Return a stored table; None if there is none that can be read."""
    import xarray  # noqa: PLC0415 - takes half a second

    try:
        with xarray.open_dataset(path, engine="h5netcdf") as stored:
            names = json.loads(stored.attrs.get(ORDER, "[]"))  # the file's own order is another
            table: xarray.Dataset = stored.load()[names]
            return table
    except (OSError, ValueError, KeyError):
        return None
