"""Where the values of a configuration stand: files, lines, key paths."""

import os
from pathlib import Path
from typing import NamedTuple

from rig.config.problems import Problem, key_text, shown

KeyPath = tuple[str | int, ...]


class Place(NamedTuple):
    """A line of a file."""

    path: Path
    line: int  # from 1


class Locate:
    """Where each value of a merged mapping came from.

    Called with a key path it gives the `Place` of that key, or of the nearest mapping around it
    that exists (a missing key is reported on the line of its mapping).
    """

    def __init__(
        self,
        path: Path,
        places: dict[KeyPath, Place],
        files: tuple[Path, ...],
        inlined: tuple[Path, ...] = (),
    ) -> None:
        self.path = path
        self.places = places
        self.files = files  # every file read: the named one first, then those it extends
        self.inlined = inlined  # those of them that hold the mapping of a key

    def __call__(self, key: KeyPath = ()) -> Place:
        """Place of a key, or of the nearest existing one around it."""
        for length in range(len(key), 0, -1):
            place = self.places.get(key[:length])
            if place is not None:
                return place
        return self.places.get((), Place(self.path, 1))

    def file(self, key: KeyPath, named: str) -> Path:
        """Path of a file named under ``key``: relative to the file in which the name stands."""
        return Path(os.path.normpath(self(key).path.parent / named))

    def problem(self, key: KeyPath, value: object, message: str) -> Problem:
        """A problem at a key."""
        place = self(key)
        return Problem(shown(place.path), place.line, key_text(key), value, message)
