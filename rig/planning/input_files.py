"""Input files of a campaign or a session: reading, order of problems, sha256."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from pydantic import BaseModel

from rig.config.problems import ConfigError, Problem, display_path, format_key
from rig.config.pydantic_errors import validate
from rig.config.yaml_source import KeyPath, SourceMap, kinds_of, load_mapping
from rig.regular_file import MAX_RECORD_BYTES, read_regular

T = TypeVar("T")
M = TypeVar("M", bound=BaseModel)


EVERYTHING_ELSE = "all else in this file and in those that it names"
"""The checks that a file that cannot be read prevents."""


class InputFile(NamedTuple):
    """An input file of a campaign or session."""

    role: str  # campaign or session, sea, rig, limits, plant, matrix, elevation, calibration
    path: Path
    sha256: str
    date: str = ""  # of a calibration, as its file gives it

    def as_dict(self) -> dict[str, str]:
        """Return the fields as JSON values, as reports and records have them."""
        date = {"date": self.date} if self.date else {}
        return {"role": self.role, "path": display_path(self.path), "sha256": self.sha256} | date


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
    name = format_key(key)
    path = owner.locate.existing_path(key, value, *kinds_of(name))
    return ConfigSource(*load(path, owner.locate(key), name, inline))


class FileReader:
    """Reads file after file and collects the problems of each."""

    def __init__(self, load: MappingLoader = load_mapping) -> None:
        self.problems: list[Problem] = []
        self.files: list[InputFile] = []
        self.unchecked: list[str] = []  # checks that the problems prevent
        self._load = load
        self._sources: list[ConfigSource] = []

    def attempt(self, step: Callable[[], T]) -> T | None:
        """Return the result of a step, or None if it found problems."""
        try:
            return step()
        except ConfigError as error:
            self.problems.extend(error.problems)
            self.unchecked.extend(error.unchecked)
            return None

    def read_first(self, role: str, path: Path, inline: tuple[str, ...] = ()) -> ConfigSource:
        """Return the campaign's or session's own file; ConfigError if it cannot be read."""
        try:
            source = ConfigSource(*self._load(path, inline=inline))
        except ConfigError as error:
            raise ConfigError(error.problems, [EVERYTHING_ELSE]) from None
        self._add(source, role)
        return source

    def read(
        self,
        role: str,
        owner: ConfigSource | None,
        key: KeyPath,
        replacement: Path | None = None,
        inline: tuple[str, ...] = (),
    ) -> ConfigSource | None:
        """Return the file named at a key of another file, or ``replacement``."""
        if owner is None:
            self.unchecked.append(f"the {role} file")
            return None
        before = len(self.problems)
        source = self.attempt(
            lambda: (
                load_named_source(owner, key, self._load, inline)
                if replacement is None
                else ConfigSource(
                    *self._load(replacement, inline=inline, kinds=kinds_of(format_key(key)))
                )
            )
        )
        if source is not None:
            self._add(source, role)
        elif len(self.problems) > before:
            self.unchecked.append(f"the {role} file")
        return source

    def validated(self, source: ConfigSource | None, model: type[M]) -> M | None:
        """Return a source as its model, or None if it is invalid."""
        if source is None:
            return None
        return self.attempt(lambda: validate(source.mapping, source.locate, model))

    def _add(self, source: ConfigSource, role: str) -> None:
        """Add the files of a source; the role of one that holds the mapping of a key is the key."""
        self._sources.append(source)
        inlined = source.locate.inlined
        date = source.mapping.get("date") if role == "calibration" else None
        self.files += [
            hash_input_file(inlined.get(path, role).replace("_", " "), path)._replace(
                date=str(date or "")
            )
            for path in source.locate.files
        ]

    def raise_problems(self, *later: str) -> None:
        """Raise `ConfigError` with all problems, in the order of the files and of their lines.

        ``later`` names the checks that need files without problems.
        """
        files = [display_path(path) for each in self._sources for path in each.locate.files]
        rank = {file: i for i, file in reversed(list(enumerate(files)))}
        if self.problems:
            order = sorted(self.problems, key=lambda p: (rank.get(p.file, len(files)), p.line))
            raise ConfigError(order, [*self.unchecked, *later])


def hash_input_file(role: str, path: Path) -> InputFile:
    """Return a file with its sha256."""
    return InputFile(role, path, hashlib.sha256(read_regular(path, MAX_RECORD_BYTES)).hexdigest())
