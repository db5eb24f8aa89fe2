"""Versions of the calibrations in a folder: the chain of supersession and the valid version."""

import hashlib
from pathlib import Path
from typing import NamedTuple

from rig.config.calibration_file import CalibrationFile
from rig.config.problems import ConfigError, Problem, display_path
from rig.config.pydantic_errors import load
from rig.config.yaml_source import SourceMap
from rig.regular_file import MAX_CONFIG_BYTES, read_regular


class CalibrationVersion(NamedTuple):
    """One version of a calibration and its file."""

    file: CalibrationFile
    path: Path
    sha256: str  # of the file

    def description(self) -> str:
        """Return the version and check sum, as products state them."""
        return f"{self.file.title} (sha256 {self.sha256[:12]})"


class CalibrationHistory(NamedTuple):
    """Every version of every calibration of a folder, by name and version."""

    folder: Path
    versions: tuple[CalibrationVersion, ...]

    def names(self) -> tuple[str, ...]:
        """Return the names of all calibrations."""
        return tuple(dict.fromkeys(calibration.file.name for calibration in self.versions))

    def chain(self, name: str) -> tuple[CalibrationVersion, ...]:
        """Return all versions of one calibration, oldest first."""
        return tuple(calibration for calibration in self.versions if calibration.file.name == name)

    def find(self, reference: str) -> CalibrationVersion:
        """Return `NAME` (its newest version) or `NAME@VERSION`; raise KeyError if there is none."""
        name, _, version = reference.partition("@")
        chain = self.chain(name)
        if not chain:
            available = ", ".join(self.names()) or "none"
            raise KeyError(
                f"no calibration {name!r} in {display_path(self.folder)}/; there are: {available}"
            )
        if not version:
            return chain[-1]
        for calibration in chain:
            if version.removeprefix("v") == str(calibration.file.version):
                return calibration
        available = ", ".join(str(calibration.file.version) for calibration in chain)
        raise KeyError(f"{name} has no version {version}; there are {available}")


def open_calibration(path: Path) -> CalibrationVersion:
    """Read one calibration file; raise `ConfigError` with every problem in it."""
    return _opened(path)[0]


def _opened(path: Path) -> tuple[CalibrationVersion, SourceMap]:
    path = Path(path)
    file, locate = load(path, CalibrationFile)
    digest = hashlib.sha256()
    for each in locate.files:
        digest.update(read_regular(each, MAX_CONFIG_BYTES))
    return CalibrationVersion(file, path, digest.hexdigest()), locate


def open_history(folder: Path) -> CalibrationHistory:
    """Read all calibration files (`*.yaml`) of a folder.

    Raise `ConfigError` with every problem of every file and of the chains of versions: a duplicate
    version, a version that supersedes a missing or already superseded one, a change of quantity
    between versions.
    """
    folder = Path(folder)
    found: list[tuple[CalibrationVersion, SourceMap]] = []
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
    return CalibrationHistory(folder, tuple(calibration for calibration, _ in found))


def _broken_chains(found: list[tuple[CalibrationVersion, SourceMap]]) -> list[Problem]:
    problems = []
    seen: dict[tuple[str, int], CalibrationVersion] = {}
    successors: dict[tuple[str, int], CalibrationVersion] = {}
    for calibration, locate in found:
        file = calibration.file
        key = (file.name, file.version)
        if key in seen:
            message = f"{file.title} is defined in {display_path(seen[key].path)} already"
            problems.append(locate.problem(("version",), file.version, message))
            continue
        seen[key] = calibration
        if file.supersedes is None:
            continue
        old = seen.get((file.name, file.supersedes))
        if old is None:
            message = f"{file.name} v{file.supersedes} does not exist"
        elif (file.name, file.supersedes) in successors:
            other = successors[file.name, file.supersedes]
            message = f"{old.file.title} is superseded by {other.file.title} already"
        elif old.file.quantity != file.quantity:
            message = f"{old.file.title} corrects {old.file.quantity}, not {file.quantity}"
        else:
            successors[file.name, file.supersedes] = calibration
            continue
        problems.append(locate.problem(("supersedes",), file.supersedes, message))
    return problems
