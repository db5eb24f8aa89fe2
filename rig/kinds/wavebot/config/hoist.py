"""The hoist of a campaign: it slowly raises and lowers the body at one stator position per row."""

from collections.abc import Iterator
from typing import Annotated

from pydantic import BeforeValidator, Field

from rig.config.matrix import expand_values
from rig.config.model import FileModel, RuleViolation, TupleOf, WholeNumber
from rig.config.problems import format_number

Station = Annotated[float, Field(ge=-100, le=100)]
"""Position of the magnetic spring's stator, %."""

TURNAROUND_S = 1.0
"""Time of a hoist's reversal at either end of its travel, s; in between its speed is constant."""


class Hoist(FileModel):
    """Travel and speed of the hoist, and the stator positions at which the travel is run."""

    stations_percent: Annotated[TupleOf[Station], BeforeValidator(expand_values)]
    low_m: float = Field(ge=-2, lt=0)  # relative to the tared zero
    high_m: float = Field(gt=0, le=2)
    speed_m_per_s: float = Field(gt=0, le=0.2)
    cycles: WholeNumber = Field(default=2, ge=1, le=20)  # per station

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that stations differ and that most of the travel is at constant speed."""
        for i, station in enumerate(self.stations_percent):
            if station in self.stations_percent[:i]:
                message = f"{format_number(station)} occurs twice; list each station once"
                yield RuleViolation(("stations_percent", i), message, station)
        max_speed = 0.25 * (self.high_m - self.low_m) / TURNAROUND_S
        if self.speed_m_per_s > max_speed:
            yield RuleViolation(
                ("speed_m_per_s",),
                f"{format_number(self.speed_m_per_s)} leaves no travel at constant speed; "
                f"allowed up to {format_number(max_speed)} m/s for this travel",
                self.speed_m_per_s,
            )

    @property
    def period(self) -> float:
        """Duration of one cycle, s: up and down at constant speed, and two reversals."""
        return 2.0 * ((self.high_m - self.low_m) / self.speed_m_per_s + 0.5 * TURNAROUND_S)

    def description(self) -> str:
        """Return one line of text."""
        return (
            f"{format_number(self.low_m)} .. {format_number(self.high_m)} m at "
            f"{format_number(self.speed_m_per_s)} m/s, {self.cycles} times a station"
        )
