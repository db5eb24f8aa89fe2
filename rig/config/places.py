"""File and line of each value of a configuration, by key path."""

import os
from pathlib import Path
from typing import NamedTuple

from rig.config.problems import Problem, display_path, format_key

KeyPath = tuple[str | int, ...]


class SourceLocation(NamedTuple):
    """A line of a file."""

    path: Path
    line: int  # from 1


class SourceMap:
    """File and line of each value of a merged mapping.

    Calling the map with a key path returns the `SourceLocation` of that key. For a missing key it
    returns the location of the nearest enclosing mapping, so that a missing key is reported on
    the line of its mapping.
    """

    def __init__(
        self,
        path: Path,
        places: dict[KeyPath, SourceLocation],
        files: tuple[Path, ...],
        inlined: tuple[Path, ...] = (),
    ) -> None:
        self.path = path
        self.locations = places
        self.files = files  # every file read: the named one first, then the files it extends
        self.inlined = inlined  # the files among them that hold the mapping of a single key

    def __call__(self, key: KeyPath = ()) -> SourceLocation:
        """Return the location of a key, or of the nearest enclosing key that exists."""
        for length in range(len(key), 0, -1):
            location = self.locations.get(key[:length])
            if location is not None:
                return location
        return self.locations.get((), SourceLocation(self.path, 1))

    def resolve_path(self, key: KeyPath, name: str) -> Path:
        """Return the path of the file that ``key`` names, relative to the file with that key."""
        return Path(os.path.normpath(self(key).path.parent / name))

    def problem(self, key: KeyPath, value: object, message: str) -> Problem:
        """Return a problem with the file and line of a key."""
        location = self(key)
        return Problem(display_path(location.path), location.line, format_key(key), value, message)
