"""The uncertainty budget of a rig: what is not known of its signals beyond their scatter (Type B).

Terms are those of the GUM (JCGM 100:2008). A source is one quantity, such as the scale of an
encoder. It may act on several signals, whose errors are then the same; sources are independent.
"""

import math
from collections.abc import Iterator
from typing import Literal

from pydantic import Field

from rig.config.model import FileModel, RuleViolation, TupleOf


class UncertaintySource(FileModel):
    """One source of uncertainty: a scale, an offset, or an alignment of some signals."""

    name: str = Field(min_length=1, max_length=64)  # of the source
    signals: TupleOf[str] = Field(min_length=1)  # of the formulas of the power stations
    scale_percent: float | None = Field(default=None, gt=0, le=100)
    """Uncertainty as a share of the value."""
    offset: float | None = Field(default=None, gt=0, le=1e9)  # in the unit of the signals
    alignment_deg: float | None = Field(default=None, gt=0, le=45)  # between axis and sensor
    distribution: Literal["normal", "rectangular", "triangular"] = "normal"
    """Of the error; with a rectangular or triangular one, the value is its half width."""
    coverage_factor: float = Field(default=1.0, ge=1, le=4)  # k of a normal one; 1: standard
    evidence: str = Field(min_length=1)  # certificate, data sheet, comparison

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that one value is given, and k of a normal distribution only."""
        given = [
            name for name in ("scale_percent", "offset", "alignment_deg") if getattr(self, name)
        ]
        if len(given) != 1:
            what = " and ".join(given) or "nothing"
            message = f"{what} given; allowed exactly one of scale_percent, offset, alignment_deg"
            yield RuleViolation((), message)
        if self.distribution != "normal" and self.coverage_factor != 1.0:
            message = "a half width has no coverage factor; leave the key out"
            yield RuleViolation(("coverage_factor",), message, self.coverage_factor)
        for i, signal in enumerate(self.signals):
            if signal in self.signals[:i]:
                yield RuleViolation(("signals", i), f"{signal} is listed twice", signal)

    @property
    def standard_scale(self) -> float:
        """Standard uncertainty of the scale of the signals, relative; 0 for an offset.

        A sensor at an angle to its axis shows too little, by 1 - cos(angle).
        """
        if self.scale_percent is not None:
            return 1e-2 * self.scale_percent / self._divisor
        if self.alignment_deg is not None:
            return (1.0 - math.cos(math.radians(self.alignment_deg))) / self._divisor
        return 0.0

    @property
    def standard_offset(self) -> float:
        """Standard uncertainty of the offset of the signals, in their unit; 0 for a scale."""
        return 0.0 if self.offset is None else self.offset / self._divisor

    @property
    def _divisor(self) -> float:
        """The value in the file over the standard uncertainty (GUM 4.3)."""
        half_widths = {"rectangular": math.sqrt(3.0), "triangular": math.sqrt(6.0)}
        return half_widths.get(self.distribution, self.coverage_factor)


class UncertaintyBudget(FileModel):
    """The Type B uncertainties of a rig's power stations."""

    name: str = Field(min_length=1, max_length=64)  # for people
    sources: TupleOf[UncertaintySource] = Field(min_length=1, max_length=100)

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that no source is listed twice."""
        names = [each.name for each in self.sources]
        for i, name in enumerate(names):
            if name in names[:i]:
                yield RuleViolation(("sources", i, "name"), f"{name} is listed twice", name)
