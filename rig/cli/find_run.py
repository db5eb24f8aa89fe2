"""Which run a person means."""

from pathlib import Path

from rig.runs import RunError, list_runs


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


def _names(paths: list[Path]) -> str:
    return ", ".join(path.name for path in paths)
