"""Which run a person means, and by which calibrations it is to be read."""

from pathlib import Path
from typing import TYPE_CHECKING

from rig.recording.runs import RunError, list_runs

if TYPE_CHECKING:
    from rig.recording.calibration import Known


def find_run(named: Path, runs: Path) -> Path:
    """A folder or file by its path, or of ``runs``: 'last', an id, a campaign, an id's beginning.

    A campaign means its newest run; a beginning must be that of one run only. Raises RunError
    saying what there is, OSError for what cannot be looked at.
    """
    if named.exists():
        return named
    listed = list_runs(runs)
    known = [run.path for run in listed]
    if str(named) == "last" and known:
        return known[-1]
    matches = [path for path in known if path.name == str(named)]
    matches = matches or [run.path for run in listed if run.campaign == str(named)][-1:]
    matches = matches or [path for path in known if path.name.startswith(str(named))]
    if len(matches) == 1:
        return matches[0]
    if matches:
        raise RunError(f"{named}: {len(matches)} runs begin so: {_names(matches)}")
    there = _names(known[-5:]) if known else "none"
    raise RunError(f"{named}: no such run or campaign in {runs}/; the newest there: {there}")


def find_calibrations(named: list[str]) -> "list[Known]":
    """The calibrations a person means, by file or name; raises as `rig calibration show` tells."""
    if not named:
        return []
    from rig.cli.calibration import FOLDER
    from rig.cli.calibration_commands import find

    return [find(name, FOLDER) for name in named]


def _names(paths: list[Path]) -> str:
    return ", ".join(path.name for path in paths)
