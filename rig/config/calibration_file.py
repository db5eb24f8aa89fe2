"""The calibration file: the corrected quantity, the correction, its validity and its reason."""

import re
from collections.abc import Iterator
from datetime import date
from typing import Annotated, Literal

from pydantic import Field, field_validator

from rig.config.model import FileModel, RuleViolation, TupleOf, WholeNumber, rule_error
from rig.config.problems import format_number, format_value
from rig.config.unit_factors import factor_note

QUANTITY_UNITS = {"spring_rate": "N/m", "torque_constant": "N*m/A", "spring_map": "N/m"}
"""Units of the quantities that every rig may have (for a spring map, the unit of its rates).

Which of a run's values these are follows from the contents of its row table: spring rate and
spring map are the column of the panels and its actuator, the torque constant is that of the
measured axis. The position of an axis is `<axis>_position`, in m.
"""

POSITION = "_position"
"""End of the name of a position, after that of its axis."""

Stroke = Annotated[float, Field(gt=0, le=2)]
"""Stroke in either direction at a position of the spring, m; beyond it its force reverses."""

TORQUE_CONSTANT_KEY = "torque_constant_n_m_per_a"
"""Key of the torque constant among the settings of an axis."""


_AXIS_NAME = re.compile(r"[a-z][a-z0-9_]*")


class ScaleCorrection(FileModel):
    """Corrected = factor * recorded."""

    kind: Literal["scale"]
    factor: float = Field(ge=-1e6, le=1e6)  # on the recorded value

    @field_validator("factor")
    @classmethod
    def _not_zero(cls, factor: float) -> float:
        if abs(factor) < 1e-6:
            raise rule_error(
                f"{format_number(factor)} cannot be inverted; allowed magnitudes from 1e-6"
            )
        return factor


class OffsetCorrection(FileModel):
    """Corrected = recorded + offset."""

    kind: Literal["offset"]
    offset: float = Field(ge=-1e6, le=1e6)  # in the unit of the calibration


class TableCorrection(FileModel):
    """Corrected = interpolation between pairs; beyond the ends there is no correction."""

    kind: Literal["table"]
    recorded: TupleOf[float] = Field(min_length=2, strict=False)  # values, rising
    corrected: TupleOf[float] = Field(min_length=2, strict=False)  # value for each recorded one

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check equal lengths, rising recorded and strictly monotone corrected values.

        These conditions make the correction invertible.
        """
        if len(self.recorded) != len(self.corrected):
            yield RuleViolation(
                ("corrected",),
                f"{len(self.corrected)} entries; allowed {len(self.recorded)}, as in recorded",
            )
            return
        yield from self.check_rising(self.recorded, ("recorded",))
        rule = "the table must {} strictly, or it has no inverse"
        yield from self.check_monotone(self.corrected, ("corrected",), rule=rule)


Correction = Annotated[
    ScaleCorrection | OffsetCorrection | TableCorrection, Field(discriminator="kind")
]


class RunRange(FileModel):
    """Runs of a numbered series, from (included) to before (excluded)."""

    series: str = Field(min_length=1, max_length=64)  # as in MASK4_051
    first: WholeNumber | None = Field(default=None, alias="from", ge=0, le=10**9)  # first run
    before: WholeNumber | None = Field(default=None, ge=0, le=10**9)  # first run beyond the range

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that at least one end is given and that the range is not empty."""
        yield from _check_ends(self.first, self.before)


class DateRange(FileModel):
    """Days in UTC on which a run started, from (included) to before (excluded)."""

    first: str | None = Field(default=None, alias="from")  # first day
    before: str | None = None  # first day beyond the range

    @field_validator("first", "before")
    @classmethod
    def _require_date(cls, text: str | None) -> str | None:
        if text is None:
            return None
        try:
            if date.fromisoformat(text).isoformat() == text:
                return text
        except ValueError:
            pass
        raise rule_error(f"{format_value(text)} is not a date; allowed as 2023-09-26")

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that at least one end is given and that the range is not empty."""
        yield from _check_ends(self.first, self.before)


def _check_ends(first: float | str | None, before: float | str | None) -> Iterator[RuleViolation]:
    if first is None and before is None:
        yield RuleViolation((), "no end given; allowed from, before, or both")
    if first is not None and before is not None and str(first) == str(before):
        yield RuleViolation(
            ("before",), f"{before} makes the range empty; allowed above from = {first}"
        )
    elif first is not None and before is not None and not _is_above(before, first):
        yield RuleViolation(("before",), f"{before} is before from = {first}", before)


def _is_above(high: float | str, low: float | str) -> bool:
    return str(high) > str(low) if isinstance(high, str) else high > low  # type: ignore[operator]


class Validity(FileModel):
    """Validity of a calibration: runs of a series, or dates."""

    runs: RunRange | None = None
    dates: DateRange | None = None

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that exactly one of runs and dates is given."""
        given = [name for name in ("runs", "dates") if getattr(self, name) is not None]
        if len(given) != 1:
            keys = " and ".join(given) if given else "nothing"
            yield RuleViolation((), f"{keys} given; allowed exactly one of runs, dates")

    def description(self) -> str:
        """Return the range as one line of text."""
        if self.runs is not None:
            return f"{self.runs.series} runs {_format_range(self.runs.first, self.runs.before)}"
        assert self.dates is not None
        return f"dates {_format_range(self.dates.first, self.dates.before)}"


def _format_range(first: float | str | None, before: float | str | None) -> str:
    ends = (
        f"from {first}" if first is not None else "",
        f"before {before}" if before is not None else "",
    )
    return " ".join(end for end in ends if end)


class CalibrationFile(FileModel):
    """One version of a calibration."""

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=64)
    """Of the calibration, for all its versions."""
    version: WholeNumber = Field(ge=1, le=10_000)  # number of the version
    quantity: str = Field(max_length=64)  # recorded quantity that is corrected
    unit: str  # of the quantity
    correction: Correction  # from recorded to corrected values
    valid: Validity
    outside: Literal["refuse", "unchanged"]  # treatment of values outside the validity
    supersedes: WholeNumber | None = Field(default=None, ge=1, le=10_000)
    """Version that it replaces."""
    source: str = Field(min_length=1)  # of the values
    reason: str = Field(min_length=1)  # for this version
    stroke_m: TupleOf[Stroke] | None = Field(default=None, strict=False)  # of a spring map

    @field_validator("quantity")
    @classmethod
    def _is_known(cls, name: str) -> str:
        axis = name.removesuffix(POSITION)
        if name in QUANTITY_UNITS or (axis != name and _AXIS_NAME.fullmatch(axis)):
            return name
        allowed = f"{', '.join(QUANTITY_UNITS)}, or <axis>{POSITION}"
        raise rule_error(f"{format_value(name)} cannot be corrected; allowed {allowed}")

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check the unit, the superseded version and the spring map.

        Every version except the first supersedes an earlier one.
        """
        unit = QUANTITY_UNITS.get(self.quantity, "m")
        if self.unit != unit:
            message = (
                f"{format_value(self.unit)} is not the unit of {self.quantity}; allowed {unit}"
            )
            if note := factor_note(self.unit, [unit]):
                message += f": {note}"
            yield self.violation("unit", message)
        if self.version == 1 and self.supersedes is not None:
            yield self.violation("supersedes", "version 1 supersedes nothing")
        if self.version > 1 and self.supersedes is None:
            message = f"supersedes missing; allowed a version before {self.version}"
            yield RuleViolation((), message)
        if self.supersedes is not None and 1 < self.version <= self.supersedes:
            message = f"{self.supersedes} is not an earlier version; allowed below {self.version}"
            yield self.violation("supersedes", message)
        yield from self._map_rules()

    def _map_rules(self) -> Iterator[RuleViolation]:
        """Check that a spring map is a table over the position (%) with a stroke per station."""
        if self.quantity != "spring_map":
            if self.stroke_m is not None:
                yield RuleViolation(
                    ("stroke_m",), f"{self.quantity} has no strokes; leave the key out"
                )
            return
        if not isinstance(self.correction, TableCorrection):
            message = f"{self.correction.kind} is not a spring map; allowed table"
            yield RuleViolation(("correction", "kind"), message, self.correction.kind)
            return
        stations = self.correction.recorded
        for i, position in enumerate(stations):
            if not -100.0 <= position <= 100.0:
                message = f"{format_number(position)} is out of range; allowed -100 .. 100 %"
                yield RuleViolation(("correction", "recorded", i), message, position)
        if len(self.stroke_m or ()) != len(stations):
            message = (
                f"{len(self.stroke_m or ())} strokes; allowed {len(stations)}, one per station"
            )
            yield RuleViolation(("stroke_m",), message)

    @property
    def title(self) -> str:
        """Name and version, as recorded in data corrected with it."""
        return f"{self.name} v{self.version}"
