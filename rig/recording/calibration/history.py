"""All versions of the calibrations in a folder: which supersedes which, and which one counts."""

import hashlib
from pathlib import Path
from typing import NamedTuple

from rig.config.calibration_file import CalibrationFile
from rig.config.problems import ConfigError, Problem, display_path
from rig.config.pydantic_errors import load
from rig.config.yaml_source import SourceMap
from rig.regular_file import MAX_CONFIG_BYTES, read_regular


class Known(NamedTuple):
    """One version and the file it stands in."""

    file: CalibrationFile
    path: Path
    sha256: str  # of the file

    def description(self) -> str:
        """What something made with it says of it."""
        return f"{self.file.title} (sha256 {self.sha256[:12]})"


class History(NamedTuple):
    """Every version of every calibration of a folder, by name and version."""

    folder: Path
    versions: tuple[Known, ...]

    def names(self) -> tuple[str, ...]:
        """Names of all calibrations."""
        return tuple(dict.fromkeys(known.file.name for known in self.versions))

    def chain(self, name: str) -> tuple[Known, ...]:
        """All versions of one calibration, oldest first."""
        return tuple(known for known in self.versions if known.file.name == name)

    def find(self, named: str) -> Known:
        """`NAME` (its newest version) or `NAME@VERSION`; KeyError saying what there is."""
        name, _, version = named.partition("@")
        chain = self.chain(name)
        if not chain:
            there = ", ".join(self.names()) or "none"
            raise KeyError(
                f"no calibration {name!r} in {display_path(self.folder)}/; there are: {there}"
            )
        if not version:
            return chain[-1]
        for known in chain:
            if version.removeprefix("v") == str(known.file.version):
                return known
        there = ", ".join(str(known.file.version) for known in chain)
        raise KeyError(f"{name} has no version {version}; there are {there}")


def open_calibration(path: Path) -> Known:
    """One calibration file; raises `ConfigError` with every problem in it."""
    return _opened(path)[0]


def _opened(path: Path) -> tuple[Known, SourceMap]:
    path = Path(path)
    file, locate = load(path, CalibrationFile)
    digest = hashlib.sha256()
    for each in locate.files:
        digest.update(read_regular(each, MAX_CONFIG_BYTES))
    return Known(file, path, digest.hexdigest()), locate


def open_history(folder: Path) -> History:
    """All calibration files (`*.yaml`) of a folder.

    Raises `ConfigError` with every problem of every file, and of the chains they form: a version
    that stands twice, one that supersedes what is not there or what another supersedes already, a
    change of quantity between versions.
    """
    folder = Path(folder)
    found: list[tuple[Known, SourceMap]] = []
    problems: list[Problem] = []
    if not folder.is_dir():
        raise ConfigError(
            [Problem(display_path(folder), 1, "", None, "no such folder of calibrations")]
        )
    for path in sorted(folder.glob("*.yaml")):
        try:
            found.append(_opened(path))
        except ConfigError as error:
            problems += error.problems
    found.sort(key=lambda entry: (entry[0].file.name, entry[0].file.version))
    problems += _broken_chains(found)
    if problems:
        raise ConfigError(problems)
    return History(folder, tuple(known for known, _ in found))


def _broken_chains(found: list[tuple[Known, SourceMap]]) -> list[Problem]:
    problems = []
    seen: dict[tuple[str, int], Known] = {}
    followed: dict[tuple[str, int], Known] = {}
    for known, locate in found:
        file = known.file
        key = (file.name, file.version)
        if key in seen:
            message = f"{file.title} stands in {display_path(seen[key].path)} already"
            problems.append(locate.problem(("version",), file.version, message))
            continue
        seen[key] = known
        if file.supersedes is None:
            continue
        old = seen.get((file.name, file.supersedes))
        if old is None:
            message = f"{file.name} v{file.supersedes} is not there"
        elif (file.name, file.supersedes) in followed:
            other = followed[file.name, file.supersedes]
            message = f"{old.file.title} is superseded by {other.file.title} already"
        elif old.file.quantity != file.quantity:
            message = f"{old.file.title} corrects {old.file.quantity}, not {file.quantity}"
        else:
            followed[file.name, file.supersedes] = known
            continue
        problems.append(locate.problem(("supersedes",), file.supersedes, message))
    return problems
