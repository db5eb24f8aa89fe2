"""Application of a calibration to numbers, and its inverse. Pure functions.

Numbers of logs and files are decimal, and so is the arithmetic here: -12000 * 0.7690 is -9228 and
comes back as -12000, to the last bit. Only the result is rounded to a float.
"""

import math
from datetime import date, datetime
from decimal import Decimal, localcontext
from typing import NamedTuple

from rig.config.calibration_file import (
    CalibrationFile,
    OffsetCorrection,
    ScaleCorrection,
    TableCorrection,
    Validity,
)
from rig.config.problems import format_number

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
