"""Input files of a campaign or a session: reading, order of problems, sha256."""

import hashlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

from rig.config.problems import Problem, display_path, format_key
from rig.config.yaml_source import KeyPath, SourceMap, load_mapping
from rig.regular_file import MAX_RECORD_BYTES, read_regular


class InputFile(NamedTuple):
    """An input file of a campaign or session."""

    role: str  # campaign or session, sea, rig, limits, plant, matrix, elevation, calibration
    path: Path
    sha256: str

    def as_dict(self) -> dict[str, str]:
        """Return the fields as JSON values, as reports and records have them."""
        return {"role": self.role, "path": display_path(self.path), "sha256": self.sha256}


class ConfigSource(NamedTuple):
    """A file as read but not validated, and the file and line of each value."""

    mapping: dict[str, Any]
    locate: SourceMap


MappingLoader = Callable[..., tuple[dict[str, Any], SourceMap]]
"""Reads a file as `rig.config.yaml_source.load_mapping` does; it may change the values."""


def load_named_source(
    owner: ConfigSource,
    key: KeyPath,
    load: MappingLoader = load_mapping,
    inline: tuple[str, ...] = (),
) -> ConfigSource | None:
    """Return the file that another file names at ``key``.

    Returns None if the value is not a file name, which the validation of ``owner`` reports.
    ``inline`` lists the keys that may name a file with their mapping.
    """
    value: Any = owner.mapping
    for part in key:
        if isinstance(value, dict):
            value = value.get(str(part))
        else:
            exists = isinstance(value, list) and isinstance(part, int) and part < len(value)
            value = value[part] if exists else None
    if not isinstance(value, str) or not value:
        return None
    path = owner.locate.resolve_path(key, value)
    return ConfigSource(*load(path, owner.locate(key), format_key(key), inline))


def sort_problems(problems: list[Problem], sources: Iterable[ConfigSource | None]) -> list[Problem]:
    """Return problems in the order of the sources' files, and by line within each file."""
    files = [display_path(path) for source in sources if source for path in source.locate.files]
    rank = {file: i for i, file in reversed(list(enumerate(files)))}
    return sorted(problems, key=lambda problem: (rank.get(problem.file, len(files)), problem.line))


def hash_input_files(
    role: str, source: ConfigSource | None, inlined_role: str = ""
) -> list[InputFile]:
    """Return the files of a source, with the files it extends.

    Files that hold the mapping of a key have the role ``inlined_role``.
    """
    if source is None:
        return []
    inlined = source.locate.inlined
    return [
        hash_input_file(inlined_role if path in inlined else role, path)
        for path in source.locate.files
    ]


def hash_input_file(role: str, path: Path) -> InputFile:
    """Return a file with its sha256."""
    return InputFile(role, path, hashlib.sha256(read_regular(path, MAX_RECORD_BYTES)).hexdigest())
