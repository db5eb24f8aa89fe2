"""The tank of a campaign: where waves are made, met and reflected."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from rig.config.model import FileModel, RuleViolation
from rig.config.problems import format_number

Distance = Annotated[float, Field(gt=0, le=2000)]
"""From the wave maker, m."""


BEFORE_REFLECTION = "end before the reflection"


class Beach(FileModel):
    """A plane beach: the water is ``slope`` shallower per metre from its start on."""

    start_m: float = Field(ge=0, le=2000)  # from the wave maker
    slope: float = Field(ge=0.005, le=10)  # 1:12 is 0.08333


class Tank(FileModel):
    """A tank of one depth, with a wall or beach that reflects waves."""

    depth_m: float = Field(ge=0.1, le=50)  # water depth
    device_m: Distance
    length_m: Distance  # to the far wall
    beach: Beach | None = None
    still_s: float = Field(default=0.0, ge=0, le=600)  # from the trigger to the first wave made
    ramp_s: float = Field(default=0.0, ge=0, le=600)  # until the wave maker has its full stroke
    windows: Literal["as planned", "end before the reflection"] = (
        "as planned"  # of the measurement of a row
    )

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the device is in the water, between wave maker and wall."""
        shore = format_number(self.shore_m)
        if self.device_m >= self.shore_m:
            message = f"{format_number(self.device_m)} m is not in the water; allowed below {shore}"
            yield self.violation("device_m", message)
        if self.beach is not None and self.beach.start_m >= self.length_m:
            message = (
                f"starts behind the wall; allowed below length_m {format_number(self.length_m)}"
            )
            yield RuleViolation(("beach", "start_m"), message, self.beach.start_m)

    @property
    def shore_m(self) -> float:
        """Distance of what reflects waves: the shore line of the beach, or the wall; m."""
        if self.beach is None:
            return self.length_m
        return min(self.length_m, self.beach.start_m + self.depth_m / self.beach.slope)
