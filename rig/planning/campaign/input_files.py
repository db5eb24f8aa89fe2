"""The files that a campaign or a session stands on, as they are read."""

import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from rig.config.problems import Problem, key_text, shown
from rig.config.yaml_source import KeyPath, Locate, load_mapping
from rig.regular_file import RECORD_MOST, read_regular


class ReadFile(NamedTuple):
    """A file that something to be run stands on."""

    role: str  # campaign or session, sea, rig, limits, plant, matrix, elevation, calibration
    path: Path
    sha256: str


class Source(NamedTuple):
    """A file as read, not validated, and where each of its values stands."""

    mapping: dict[str, Any]
    locate: Locate


Load = Callable[..., tuple[dict[str, Any], Locate]]
"""Reads a file as `rig.config.yaml_source.load_mapping` does; it may change what the file says."""


def named_source(
    owner: Source, key: KeyPath, load: Load = load_mapping, inline: tuple[str, ...] = ()
) -> Source | None:
    """The file another one names; None where the name itself is a problem told elsewhere.

    ``inline`` are its keys that may name a file with their mapping.
    """
    value: Any = owner.mapping
    for part in key:
        if isinstance(value, dict):
            value = value.get(str(part))
        else:
            inside = isinstance(value, list) and isinstance(part, int) and part < len(value)
            value = value[part] if inside else None
    if not isinstance(value, str) or not value:
        return None
    path = owner.locate.file(key, value)
    return Source(*load(path, owner.locate(key), key_text(key), inline))


def in_order(problems: list[Problem], sources: Iterable[Source | None]) -> list[Problem]:
    """File by file, the first source's first, and down each file."""
    files = [shown(path) for opened in sources if opened for path in opened.locate.files]
    rank = {file: i for i, file in reversed(list(enumerate(files)))}
    return sorted(problems, key=lambda problem: (rank.get(problem.file, len(files)), problem.line))


def read_files(role: str, opened: Source | None, inlined_role: str = "") -> list[ReadFile]:
    """The files of a source with those they extend and, by their role, those of its keys."""
    if opened is None:
        return []
    inlined = opened.locate.inlined
    return [
        read_file(inlined_role if path in inlined else role, path) for path in opened.locate.files
    ]


def read_file(role: str, path: Path) -> ReadFile:
    """A file with its hash."""
    return ReadFile(role, path, hashlib.sha256(read_regular(path, RECORD_MOST)).hexdigest())
