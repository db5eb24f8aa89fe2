"""The calibration file: what is corrected, by how much, where it holds, and why."""

from collections.abc import Iterator
from datetime import date
from typing import Annotated, Literal

from pydantic import Field, field_validator

from rig.config.model import Broken, FileModel, Several, Whole, refuse
from rig.config.problems import number_text, value_text

UNITS = {
    "spring_rate": "N/m",
    "torque_constant": "N*m/A",
    "heave_position": "m",
    "spring_map": "N/m",
}
"""Quantities that can be corrected, each with its one unit (of a spring map that of the rates)."""

Stroke = Annotated[float, Field(gt=0, le=2)]
"""Stroke either way at a stator position, m: beyond it the stator's force reverses."""

TORQUE_CONSTANT = ("rig", "heave", "torque_constant_n_m_per_a")
"""Keys of a run's configuration under which it stands."""


class Scale(FileModel):
    """Corrected = factor * recorded."""

    kind: Literal["scale"]
    factor: float = Field(ge=-1e6, le=1e6)

    @field_validator("factor")
    @classmethod
    def _not_zero(cls, factor: float) -> float:
        if abs(factor) < 1e-6:
            raise refuse(f"{number_text(factor)} leaves nothing to take back; allowed away from 0")
        return factor


class Offset(FileModel):
    """Corrected = recorded + offset."""

    kind: Literal["offset"]
    offset: float = Field(ge=-1e6, le=1e6)  # in the unit of the calibration


class Table(FileModel):
    """Corrected is interpolated between pairs; beyond the ends there is no correction."""

    kind: Literal["table"]
    recorded: Several[float] = Field(min_length=2, strict=False)
    corrected: Several[float] = Field(min_length=2, strict=False)

    def broken_rules(self) -> Iterator[Broken]:
        """Equally long, recorded rising, corrected strictly monotone: it can be taken back."""
        if len(self.recorded) != len(self.corrected):
            yield Broken(
                ("corrected",),
                f"{len(self.corrected)} entries; allowed {len(self.recorded)}, as in recorded",
            )
            return
        falling = self.corrected[1] < self.corrected[0]
        for i in range(1, len(self.recorded)):
            before, here = self.recorded[i - 1], self.recorded[i]
            if here <= before:
                yield Broken(
                    ("recorded", i),
                    f"{number_text(here)} does not rise above {number_text(before)}",
                    here,
                )
            before, here = self.corrected[i - 1], self.corrected[i]
            if here == before or falling != (here < before):
                way = "fall" if falling else "rise"
                yield Broken(
                    ("corrected", i),
                    f"{number_text(here)} after {number_text(before)}: the table must {way} "
                    "strictly, or it cannot be taken back",
                    here,
                )


Correction = Annotated[Scale | Offset | Table, Field(discriminator="kind")]


class Runs(FileModel):
    """Runs of a numbered series, from (included) to before (excluded)."""

    series: str = Field(min_length=1, max_length=64)  # as in MASK4_051
    first: Whole | None = Field(default=None, alias="from", ge=0, le=10**9)
    before: Whole | None = Field(default=None, ge=0, le=10**9)

    def broken_rules(self) -> Iterator[Broken]:
        """At least one end, and something between both."""
        yield from _ends(self.first, self.before)


class Dates(FileModel):
    """Days in UTC on which a run started, from (included) to before (excluded)."""

    first: str | None = Field(default=None, alias="from")
    before: str | None = None

    @field_validator("first", "before")
    @classmethod
    def _a_date(cls, text: str | None) -> str | None:
        if text is None:
            return None
        try:
            if date.fromisoformat(text).isoformat() == text:
                return text
        except ValueError:
            pass
        raise refuse(f"{value_text(text)} is not a date; allowed as 2023-09-26")

    def broken_rules(self) -> Iterator[Broken]:
        """At least one end, and something between both."""
        yield from _ends(self.first, self.before)


def _ends(first: float | str | None, before: float | str | None) -> Iterator[Broken]:
    if first is None and before is None:
        yield Broken((), "no end given; allowed from, before, or both")
    if first is not None and before is not None and str(first) == str(before):
        yield Broken(("before",), f"{before} holds for nothing; allowed above from = {first}")
    elif first is not None and before is not None and not _above(before, first):
        yield Broken(("before",), f"{before} lies before from = {first}", before)


def _above(high: float | str, low: float | str) -> bool:
    return str(high) > str(low) if isinstance(high, str) else high > low  # type: ignore[operator]


class Valid(FileModel):
    """Where a calibration holds: runs of a series, or dates."""

    runs: Runs | None = None
    dates: Dates | None = None

    def broken_rules(self) -> Iterator[Broken]:
        """Exactly one of runs, dates."""
        given = [name for name in ("runs", "dates") if getattr(self, name) is not None]
        if len(given) != 1:
            found = " and ".join(given) if given else "nothing"
            yield Broken((), f"{found} given; allowed exactly one of runs, dates")

    def description(self) -> str:
        """The range in a line."""
        if self.runs is not None:
            return f"{self.runs.series} runs {_range_words(self.runs.first, self.runs.before)}"
        assert self.dates is not None
        return f"dates {_range_words(self.dates.first, self.dates.before)}"


def _range_words(first: float | str | None, before: float | str | None) -> str:
    ends = (
        f"from {first}" if first is not None else "",
        f"before {before}" if before is not None else "",
    )
    return " ".join(end for end in ends if end)


class CalibrationFile(FileModel):
    """One version of a calibration."""

    name: str = Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=64)
    version: Whole = Field(ge=1, le=10_000)
    quantity: Literal["spring_rate", "torque_constant", "heave_position", "spring_map"]
    unit: str
    correction: Correction
    valid: Valid
    outside: Literal["refuse", "unchanged"]  # what becomes of a value outside the range
    supersedes: Whole | None = Field(default=None, ge=1, le=10_000)
    source: str = Field(min_length=1)
    reason: str = Field(min_length=1)
    stroke_m: Several[Stroke] | None = Field(default=None, strict=False)  # of a spring map

    def broken_rules(self) -> Iterator[Broken]:
        """The unit is the quantity's, and every version but the first supersedes an earlier one."""
        unit = UNITS[self.quantity]
        if self.unit != unit:
            message = f"{value_text(self.unit)} is not the unit of {self.quantity}; allowed {unit}"
            yield Broken(("unit",), message, self.unit)
        if self.version == 1 and self.supersedes is not None:
            yield Broken(("supersedes",), "version 1 supersedes nothing", self.supersedes)
        if self.version > 1 and self.supersedes is None:
            message = f"supersedes missing; allowed a version before {self.version}"
            yield Broken((), message)
        if self.supersedes is not None and 1 < self.version <= self.supersedes:
            yield Broken(
                ("supersedes",),
                f"{self.supersedes} is no earlier version; allowed below version {self.version}",
                self.supersedes,
            )
        yield from self._map_rules()

    def _map_rules(self) -> Iterator[Broken]:
        """A spring map is a table of rates over stator position (%), with a stroke for each."""
        if self.quantity != "spring_map":
            if self.stroke_m is not None:
                yield Broken(("stroke_m",), f"{self.quantity} has no strokes; leave the key out")
            return
        if not isinstance(self.correction, Table):
            message = f"{self.correction.kind} is no spring map; allowed table"
            yield Broken(("correction", "kind"), message, self.correction.kind)
            return
        stations = self.correction.recorded
        for i, stator in enumerate(stations):
            if not -100.0 <= stator <= 100.0:
                message = f"{number_text(stator)} is out of range; allowed -100 .. 100 %"
                yield Broken(("correction", "recorded", i), message, stator)
        if len(self.stroke_m or ()) != len(stations):
            message = f"{len(self.stroke_m or ())} strokes; allowed {len(stations)}, one a station"
            yield Broken(("stroke_m",), message)

    @property
    def title(self) -> str:
        """Name and version, as what was made with it says."""
        return f"{self.name} v{self.version}"
