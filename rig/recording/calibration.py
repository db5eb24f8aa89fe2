"""Calibrations: versioned corrections of recorded values, each with its range of validity.

A record is never rewritten. Its values are corrected when they are read with a calibration, and
every product names the version of the calibration that was used. The files of a folder form the
chain of versions of each calibration.

Numbers of logs and files are decimal, and so is the arithmetic here: -12000 * 0.7690 is -9228 and
comes back as -12000, to the last bit. Only the result is rounded to a float.
"""

import hashlib
import math
from datetime import date, datetime
from decimal import Decimal, localcontext
from pathlib import Path
from typing import NamedTuple

from rig.config.calibration_file import (
    CalibrationFile,
    OffsetCorrection,
    ScaleCorrection,
    TableCorrection,
    Validity,
)
from rig.config.problems import ConfigError, Problem, display_path, format_number
from rig.config.pydantic_errors import load
from rig.config.yaml_source import SourceMap
from rig.regular_file import MAX_CONFIG_BYTES, read_regular

DIGITS = 40  # of the decimal arithmetic; a float has 17


class ValidityError(ValueError):
    """A calibration does not hold for a value, run or date, or this cannot be determined."""


class RecordingTime(NamedTuple):
    """Run number and date of a recording, as far as known."""

    series: str = ""  # series of numbered runs; empty where runs have no number
    run: int | None = None
    day: date | None = None  # UTC

    @staticmethod
    def from_utc(started_utc: str) -> "RecordingTime":
        """Return the date of an ISO 8601 time; runs of this rig have no number in a series."""
        return RecordingTime(
            day=datetime.fromisoformat(started_utc).date() if started_utc else None
        )

    def description(self) -> str:
        """Return run number and date as text."""
        parts = [f"{self.series} run {self.run}".strip()] if self.run is not None else []
        parts += [self.day.isoformat()] if self.day is not None else []
        return ", ".join(parts) or "a value without run or date"


class CalibratedValue(NamedTuple):
    """A value, the number it was computed from, and the calibration used."""

    value: float
    given: float  # the original value
    by: str  # name and version of the calibration
    inside: bool  # within the range of validity; outside it the value is the original one

    def description(self) -> str:
        """Return the computation of the value as one line of text."""
        if self.inside:
            return f"{format_number(self.given)} by {self.by} is {format_number(self.value)}"
        return f"{format_number(self.given)}: outside the range of {self.by}, unchanged"


def apply_correction(
    correction: ScaleCorrection | OffsetCorrection | TableCorrection,
    value: float,
    *,
    invert: bool = False,
) -> float:
    """Return the corrected value of a recorded one; with ``invert``, the recorded of a corrected.

    Raise `ValidityError` beyond the ends of a table, ValueError for a value or result that is not
    finite.
    """
    number = _decimal(value)
    with localcontext() as context:
        context.prec = DIGITS
        if isinstance(correction, ScaleCorrection):
            factor = _decimal(correction.factor)
            return _float(number / factor if invert else number * factor)
        if isinstance(correction, OffsetCorrection):
            offset = _decimal(correction.offset)
            return _float(number - offset if invert else number + offset)
        if invert:
            return _interpolate(correction.corrected, correction.recorded, value)
        return _interpolate(correction.recorded, correction.corrected, value)


def is_valid(valid: Validity, time: RecordingTime) -> bool:
    """Return whether a calibration holds at ``time``; raise `ValidityError` if that is unknown."""
    if valid.runs is not None:
        if time.run is None or not time.series:
            raise ValidityError(
                f"valid for {valid.description()}; of {time.description()} no run number is known"
            )
        return (
            time.series == valid.runs.series
            and (valid.runs.first is None or time.run >= valid.runs.first)
            and (valid.runs.before is None or time.run < valid.runs.before)
        )
    assert valid.dates is not None
    if time.day is None:
        raise ValidityError(
            f"valid for {valid.description()}; of {time.description()} no date is known"
        )
    day = time.day.isoformat()
    return (valid.dates.first is None or day >= valid.dates.first) and (
        valid.dates.before is None or day < valid.dates.before
    )


def apply_calibration(
    calibration: CalibrationFile, value: float, time: RecordingTime, *, invert: bool = False
) -> CalibratedValue:
    """Return a recorded value as read with a calibration; with ``invert``, a corrected as recorded.

    Raise `ValidityError` where the calibration does not hold and its file has `outside: refuse`.
    """
    inside = is_valid(calibration.valid, time)
    if not inside and calibration.outside == "refuse":
        raise ValidityError(
            f"{calibration.title} does not hold for {time.description()}: "
            f"valid for {calibration.valid.description()}"
        )
    result = float(value)
    if inside:
        result = apply_correction(calibration.correction, value, invert=invert)
    return CalibratedValue(result, float(value), calibration.title, inside)


def _interpolate(xs: tuple[float, ...], ys: tuple[float, ...], value: float) -> float:
    """Return the linear interpolation; it is exact at the pairs."""
    if xs[0] > xs[-1]:
        xs, ys = xs[::-1], ys[::-1]
    if not xs[0] <= value <= xs[-1]:
        ends = f"{format_number(xs[0])} .. {format_number(xs[-1])}"
        raise ValidityError(f"{format_number(value)} is outside the table; allowed {ends}")
    i = max(i for i in range(len(xs) - 1) if xs[i] <= value)
    x0, x1 = _decimal(xs[i]), _decimal(xs[i + 1])
    y0, y1 = _decimal(ys[i]), _decimal(ys[i + 1])
    return _float(y0 + (_decimal(value) - x0) * (y1 - y0) / (x1 - x0))


def _decimal(value: float) -> Decimal:
    """Return the shortest decimal number that reads back as this float."""
    if not math.isfinite(value):
        raise ValueError(f"{format_number(value)} is not a finite number")
    return Decimal(repr(float(value)))


def _float(number: Decimal) -> float:
    value = float(number)
    if not math.isfinite(value):
        raise ValueError(f"{number:.3e} is larger than any float")
    return value


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
