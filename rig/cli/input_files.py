"""Lookup of the files, runs and calibrations that a person names, and of a run's products."""

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from rig.config.shipped_files import CAMPAIGNS, KINDS, RIGS, SESSIONS, find_file, local_copies
from rig.kinds.registry import find
from rig.recording.runs import RunError, list_runs, run_info

if TYPE_CHECKING:
    from rig.kinds.interface import Products
    from rig.recording.calibration import CalibrationVersion


__all__ = ["CAMPAIGNS", "RIGS", "SESSIONS", "input_file", "rig_file"]


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


def find_run(name: Path, runs: Path) -> Path:
    """Return the path of a run.

    ``name`` is the path of a folder or file, or names a run in ``runs``: 'last', an id, a
    campaign (its newest run), or the beginning of exactly one id. Raises RunError with the newest
    runs there are, and OSError if the folder cannot be read.
    """
    if name.exists():
        return name
    listed = list_runs(runs)
    paths = [run.path for run in listed]
    if str(name) == "last" and paths:
        return paths[-1]
    matches = [path for path in paths if path.name == str(name)]
    matches = matches or [run.path for run in listed if run.campaign == str(name)][-1:]
    matches = matches or [path for path in paths if path.name.startswith(str(name))]
    if len(matches) == 1:
        return matches[0]
    if matches:
        raise RunError(
            f"{name}: {len(matches)} runs begin so; give more of the id: {_names(matches)}"
        )
    newest = _names(paths[-5:]) if paths else "none"
    raise RunError(f"{name}: no such run or campaign in {runs}/; the newest there: {newest}")


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


def run_folder(run: Path) -> Path:
    """Return the folder of a run that is given by its folder or by an MCAP file."""
    return run if run.is_dir() else run.parent


def products_of(run: Path) -> "Products":
    """Return what a run's kind of rig makes of it.

    A record that does not name its kind has the rows of a campaign. KindError if the kind cannot be
    used here.
    """
    kind = run_info(run).kind
    if not kind:
        from rig.analysis import report

        return report
    products: Products = find(kind).room("products")
    return products


def find_calibrations(names: list[str]) -> "list[CalibrationVersion]":
    """Return calibrations by file or name; raises the same errors as `rig calibration show`."""
    if not names:
        return []
    from rig.cli.calibration import find_calibration
    from rig.cli.options import CALIBRATIONS, calibrations_folder

    folder = calibrations_folder(CALIBRATIONS)
    return [find_calibration(name, folder) for name in names]


def _names(paths: list[Path]) -> str:
    return ", ".join(path.name for path in paths)
