"""Lookup of the runs that a person names, and of what their kind of rig makes of them."""

from pathlib import Path
from typing import TYPE_CHECKING

from rig.kinds.registry import find
from rig.recording.runs import RunError, list_runs, run_info

if TYPE_CHECKING:
    from rig.kinds.interface import Products


def find_run(name: Path, runs: Path) -> Path:
    """Return the path of a run.

    ``name`` is the path of a folder or file, or names a run in ``runs``: 'last', an id, a
    campaign (its newest run), or the beginning of exactly one id. 'last' and a campaign skip runs
    that were refused before their record began, unless there are no others. Raises RunError with
    the newest runs there are, and OSError if the folder cannot be read.
    """
    if name.exists():
        return name
    listed = list_runs(runs)
    paths = [run.path for run in listed]
    by_record = sorted(listed, key=lambda run: not run.never_began)  # refused ones first
    if str(name) == "last" and paths:
        return by_record[-1].path
    matches = [path for path in paths if path.name == str(name)]
    matches = matches or [run.path for run in by_record if run.campaign == str(name)][-1:]
    matches = matches or [path for path in paths if path.name.startswith(str(name))]
    if len(matches) == 1:
        return matches[0]
    if matches:
        raise RunError(
            f"{name}: {len(matches)} runs begin so; give more of the id: {_names(matches)}"
        )
    newest = _names(paths[-5:]) if paths else "none"
    raise RunError(f"{name}: no such run or campaign in {runs}/; the newest there: {newest}")


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


def _names(paths: list[Path]) -> str:
    return ", ".join(path.name for path in paths)
