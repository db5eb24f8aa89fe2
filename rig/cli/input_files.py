"""Lookup of the campaigns, sessions and rigs that a person names by file or by shipped name."""

import sys
from pathlib import Path

from rig.config.shipped_files import CAMPAIGNS, KINDS, RIGS, SESSIONS, find_file, local_copies

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
