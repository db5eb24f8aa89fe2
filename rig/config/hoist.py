"""The hoist of a campaign: it raises and lowers the body slowly, at one stator position a row."""

from collections.abc import Iterator
from typing import Annotated

from pydantic import BeforeValidator, Field

from rig.config.matrix import expanded
from rig.config.model import Broken, FileModel, Several, Whole
from rig.config.problems import number_text

Station = Annotated[float, Field(ge=-100, le=100)]
"""Position of the magnetic spring's stator, %."""

TURN_S = 1.0
"""Time in which a hoist turns round at either end, s: between them its speed is constant."""


class Hoist(FileModel):
    """Travel and speed of the hoist, and the stator positions at which it is walked through."""

    stations_percent: Annotated[Several[Station], BeforeValidator(expanded)]
    low_m: float = Field(ge=-2, lt=0)  # from the tared zero
    high_m: float = Field(gt=0, le=2)
    speed_m_per_s: float = Field(gt=0, le=0.2)
    cycles: Whole = Field(default=2, ge=1, le=20)  # raised and lowered so often a station

    def broken_rules(self) -> Iterator[Broken]:
        """Stations differ, and most of the way is at constant speed."""
        for i, station in enumerate(self.stations_percent):
            if station in self.stations_percent[:i]:
                message = f"{number_text(station)} stands twice"
                yield Broken(("stations_percent", i), message, station)
        most = 0.25 * (self.high_m - self.low_m) / TURN_S
        if self.speed_m_per_s > most:
            yield Broken(
                ("speed_m_per_s",),
                f"{number_text(self.speed_m_per_s)} leaves no way at constant speed; "
                f"allowed up to {number_text(most)} m/s for this travel",
                self.speed_m_per_s,
            )

    @property
    def period(self) -> float:
        """Seconds of one raising and lowering: both ways at constant speed, and two turns."""
        return 2.0 * ((self.high_m - self.low_m) / self.speed_m_per_s + 0.5 * TURN_S)

    def description(self) -> str:
        """The hoist in a line."""
        return (
            f"{number_text(self.low_m)} .. {number_text(self.high_m)} m at "
            f"{number_text(self.speed_m_per_s)} m/s, {self.cycles} times a station"
        )
