"""Lookup of the files, runs and calibrations that a person names on the command line."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rig.api.run_lookup import find_run, products_of, run_folder
from rig.config.shipped_files import CAMPAIGNS, KINDS, RIGS, SESSIONS, find_file, local_copies
from rig.recording.runs import RunError, list_runs, run_info

if TYPE_CHECKING:
    from rig.recording.calibration import CalibrationVersion


__all__ = [
    "CAMPAIGNS",
    "RIGS",
    "SESSIONS",
    "find_run",
    "input_file",
    "products_of",
    "rig_file",
    "run_folder",
]


def input_file(name: Path, *kinds: str) -> Path:
    """Return the path of a file, or of the shipped file of that name.

    Raises `UnknownNameError` if there is neither.

    Prints a note on standard error if a file in the current folder looks like an edited copy of the
    shipped one.
    """
    found = find_file(name, *kinds)
    if isinstance(found, Path):
        return found
    for copy in local_copies(found):
        print(
            f"note: {name} is the shipped {KINDS[found.kind]}; for your file write {copy}",
            file=sys.stderr,
        )
    return found.path


def rig_file(name: Path | None) -> Path | None:
    """Return the path of the rig that --rig names; None without one."""
    return None if name is None else input_file(name, RIGS)


def running_runs(runs: Path) -> list[Path]:
    """Return the folders of the runs in ``runs`` that run, the newest last."""
    return [each.path for each in list_runs(runs) if each.status == "running"]


def find_run_of_kind(kind: str, name: Path, runs: Path, instead: str = "") -> Path:
    """Return the path of a run as `find_run` does; RunError if its record names another kind.

    ``instead``: for the message, what serves runs of other kinds.
    """
    path = find_run(name, runs)
    recorded = run_info(path).kind
    if recorded not in ("", kind):  # records without the kind are imported or from early versions
        message = f"{path}: needs a run of kind {kind}; this one is {recorded}"
        raise RunError("; ".join(filter(None, (message, instead))))
    return path


def find_calibrations(names: list[str]) -> "list[CalibrationVersion]":
    """Return calibrations by file or name; raises the same errors as `rig calibration show`."""
    if not names:
        return []
    from rig.cli.calibration import find_calibration
    from rig.cli.options import CALIBRATIONS, calibrations_folder

    folder = calibrations_folder(CALIBRATIONS)
    return [find_calibration(name, folder) for name in names]
