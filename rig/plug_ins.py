"""Plug-ins: names that installed distributions register by entry points, and their errors."""

import traceback
from collections.abc import Mapping
from functools import cache
from typing import NamedTuple

DISTRIBUTION = "wec-rig"


class Entry(NamedTuple):
    """A registered name."""

    name: str
    module: str
    origin: str  # distribution and version


class Registry:
    """The entries of one group of entry points.

    The modules of this distribution come from a table: it spares a process the search of all
    installed distributions, and it works in a source tree that is not installed.
    """

    def __init__(self, group: str, noun: str, own_modules: Mapping[str, str]) -> None:
        """``noun``: what a name stands for, in messages."""
        self._group, self._noun, self._own = group, noun, own_modules

    def entries(self) -> tuple[Entry, ...]:
        """Return all entries; one for each module that a name is registered for."""
        return _entries(self._group, tuple(self._own.items()))

    def names(self) -> list[str]:
        """Return all registered names, those of this distribution first."""
        return list(dict.fromkeys(entry.name for entry in self.entries()))

    def find(self, name: str) -> Entry | None:
        """Return the first entry of a name; None if there is none."""
        return next((entry for entry in self.entries() if entry.name == name), None)

    def duplicates(self, entry: Entry) -> str:
        """Return why a name is ambiguous: two modules have it; empty if one has."""
        same = [each for each in self.entries() if each.name == entry.name]
        if len({each.module for each in same}) == 1:
            return ""
        origins = " and ".join(f"{each.origin} ({each.module})" for each in same)
        return (
            f"two distributions register the {self._noun} {entry.name!r}: {origins}; uninstall "
            "one of them"
        )


@cache
def _entries(group: str, own_modules: tuple[tuple[str, str], ...]) -> tuple[Entry, ...]:
    from importlib import metadata  # noqa: PLC0415  (only where a name is looked up)

    try:
        own = f"{DISTRIBUTION} {metadata.version(DISTRIBUTION)}"
    except metadata.PackageNotFoundError:
        own = DISTRIBUTION
    found = dict.fromkeys(own_modules, own)
    for point in metadata.entry_points(group=group):
        distribution = point.dist
        origin = f"{distribution.name} {distribution.version}" if distribution else "unknown"
        found.setdefault((point.name, point.value), origin)
    return tuple(Entry(*key, origin) for key, origin in found.items())


def error_text(error: BaseException, path: str = "") -> str:
    """Return an exception with the file and line in ``path``, else with those that raised it."""
    frames = traceback.extract_tb(error.__traceback__)
    own = [frame for frame in frames if frame.filename == path]
    own = own or [frame for frame in frames if not frame.filename.startswith("<frozen")] or frames
    file, line = (own[-1].filename, own[-1].lineno) if own else (path, 0)
    if isinstance(error, SyntaxError) and error.filename:
        file, line = error.filename, error.lineno
    return f"{file}:{line}: {type(error).__name__}: {error}"
