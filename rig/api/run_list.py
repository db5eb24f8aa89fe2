"""`rig.runs`: the runs in a folder."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

from rig.api.errors import RigError, public_errors
from rig.recording.runs import list_runs

if TYPE_CHECKING:
    import pandas


def runs(folder: str | os.PathLike[str] = "runs") -> "pandas.DataFrame":
    """Return the runs in a folder, newest first, as `rig runs` lists them.

    Columns: `campaign`, `mode`, `status`, `rows_done`, `rows_planned`, `started_utc`, `record`,
    `problem` and `size` (bytes), indexed by the id that `rig.open` takes.

    Raises:
        RigError: If there is no such folder.
    """
    import pandas

    path = Path(folder)
    if not path.is_dir():
        raise RigError(f"{path}: no such folder")
    with public_errors():
        found = list_runs(path)[::-1]
    columns = (
        "run", "campaign", "mode", "status", "rows_done", "rows_planned", "started_utc", "record",
        "problem", "size",
    )  # fmt: skip
    lines = [{name: getattr(each, name) for name in columns} for each in found]
    frame = pandas.DataFrame(lines, columns=list(columns)).set_index("run")
    return frame.astype({"rows_done": "Int64", "rows_planned": "Int64"})
