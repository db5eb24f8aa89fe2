"""The row table of a run: read from its ``rows.nc`` where that is current, else computed.

A table depends on the record, the recorded plan and configuration, the status of the run, and the
code that computes it. A stored table names all of these as they were, and is current where they are
the same now. Calibrations change a table, so theirs is always computed, as that of a run in
progress. A table by code with local changes is not stored; a process keeps its newest one.
"""

import json
import os
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

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
    code = provenance.describe_code()
    source = _source(folder, code)
    if not source:
        return row_table(run)
    if code["dirty"]:  # its next changes will not show in `source`, so it is not stored
        return computed_table(folder.resolve(), source).copy(deep=True)
    stored = _read(folder / ROWS)
    if stored is not None and stored.attrs.get(COMPUTED_FROM) == source:
        return stored
    table = computed_table(folder.resolve(), source).copy(deep=True)
    return table.assign_attrs({COMPUTED_FROM: source, ORDER: json.dumps([*table.variables])})


@lru_cache(maxsize=1)
def computed_table(folder: Path, source: str) -> "xarray.Dataset":
    """Compute the table of a run; that of the same ``source`` again costs nothing.

    Callers must copy it before they change it.
    """
    return row_table(folder)


def _source(folder: Path, code: dict[str, Any]) -> str:
    """Return all on which a table depends as text; empty for a run that goes on."""
    status = read_json(folder / STATUS)
    if status.get("status", "running") == "running":
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
