"""A calibration applied to numbers, and taken back. Pure functions.

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

DIGITS = 40  # of the arithmetic between two floats of 17


class OutsideError(ValueError):
    """A value, run or date for which a calibration does not hold, or of which it cannot be told."""


class At(NamedTuple):
    """What is known of when a value was recorded."""

    series: str = ""  # of numbered runs; empty where runs have no number
    run: int | None = None
    day: date | None = None  # UTC

    @staticmethod
    def on(started_utc: str) -> "At":
        """On the day of an ISO 8601 time: runs of this rig have no number in a series."""
        return At(day=datetime.fromisoformat(started_utc).date() if started_utc else None)

    def description(self) -> str:
        """The same in words."""
        said = [f"{self.series} run {self.run}".strip()] if self.run is not None else []
        said += [self.day.isoformat()] if self.day is not None else []
        return ", ".join(said) or "a value without run or date"


class Applied(NamedTuple):
    """A value with the number it was made from and the calibration that was used."""

    value: float
    given: float
    by: str  # name and version
    inside: bool  # of the range of validity; outside it the value is the given one

    def description(self) -> str:
        """What produced the value, in a line."""
        if self.inside:
            return f"{format_number(self.given)} by {self.by} is {format_number(self.value)}"
        return f"{format_number(self.given)}: outside the range of {self.by}, unchanged"


def apply(correction: ScaleCorrection | OffsetCorrection | TableCorrection, value: float) -> float:
    """The corrected value of a recorded one.

    Raises `OutsideError` beyond the ends of a table, ValueError for a value that is not finite or
    does not stay so.
    """
    if isinstance(correction, TableCorrection):
        return _between(correction.recorded, correction.corrected, value)
    return _plain(correction, value, forward=True)


def invert(correction: ScaleCorrection | OffsetCorrection | TableCorrection, value: float) -> float:
    """The recorded value of a corrected one; raises as `apply` does."""
    if isinstance(correction, TableCorrection):
        return _between(correction.corrected, correction.recorded, value)
    return _plain(correction, value, forward=False)


def holds(valid: Validity, at: At) -> bool:
    """Whether a calibration holds there; `OutsideError` if that cannot be told."""
    if valid.runs is not None:
        if at.run is None or not at.series:
            raise OutsideError(
                f"valid for {valid.description()}; of {at.description()} no run number is known"
            )
        return (
            at.series == valid.runs.series
            and (valid.runs.first is None or at.run >= valid.runs.first)
            and (valid.runs.before is None or at.run < valid.runs.before)
        )
    assert valid.dates is not None
    if at.day is None:
        raise OutsideError(
            f"valid for {valid.description()}; of {at.description()} no date is known"
        )
    day = at.day.isoformat()
    return (valid.dates.first is None or day >= valid.dates.first) and (
        valid.dates.before is None or day < valid.dates.before
    )


def corrected(calibration: CalibrationFile, value: float, at: At) -> Applied:
    """A recorded value as it is read with a calibration.

    Raises `OutsideError` where the calibration does not hold and its file says `outside: refuse`.
    """
    inside = _inside(calibration, at)
    made = apply(calibration.correction, value) if inside else float(value)
    return Applied(made, float(value), calibration.title, inside)


def recorded(calibration: CalibrationFile, value: float, at: At) -> Applied:
    """A corrected value as it would stand in the record; raises as `corrected` does."""
    inside = _inside(calibration, at)
    made = invert(calibration.correction, value) if inside else float(value)
    return Applied(made, float(value), calibration.title, inside)


def _inside(calibration: CalibrationFile, at: At) -> bool:
    inside = holds(calibration.valid, at)
    if not inside and calibration.outside == "refuse":
        raise OutsideError(
            f"{calibration.title} does not hold for {at.description()}: "
            f"valid for {calibration.valid.description()}"
        )
    return inside


def _plain(correction: ScaleCorrection | OffsetCorrection, value: float, *, forward: bool) -> float:
    number = _decimal(value)
    with localcontext() as context:
        context.prec = DIGITS
        if isinstance(correction, ScaleCorrection):
            factor = _decimal(correction.factor)
            made = number * factor if forward else number / factor
        else:
            offset = _decimal(correction.offset)
            made = number + offset if forward else number - offset
    return _float(made)


def _between(known: tuple[float, ...], wanted: tuple[float, ...], value: float) -> float:
    """Linear interpolation; exact at the pairs."""
    number = _decimal(value)
    if known[0] > known[-1]:
        known, wanted = known[::-1], wanted[::-1]
    if not known[0] <= value <= known[-1]:
        ends = f"{format_number(known[0])} .. {format_number(known[-1])}"
        raise OutsideError(f"{format_number(value)} is outside the table; allowed {ends}")
    i = max(i for i in range(len(known) - 1) if known[i] <= value)
    x0, x1 = _decimal(known[i]), _decimal(known[i + 1])
    y0, y1 = _decimal(wanted[i]), _decimal(wanted[i + 1])
    with localcontext() as context:
        context.prec = DIGITS
        return _float(y0 + (number - x0) * (y1 - y0) / (x1 - x0))


def _decimal(value: float) -> Decimal:
    """The shortest decimal number that reads back as this float."""
    if not math.isfinite(value):
        raise ValueError(f"{format_number(value)} is not a finite number")
    return Decimal(repr(float(value)))


def _float(number: Decimal) -> float:
    value = float(number)
    if not math.isfinite(value):
        raise ValueError(f"{number:.3e} is larger than any float")
    return value
