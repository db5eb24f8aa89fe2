"""The limits of a modular rig. No limit has a default: a file without one of them is refused."""

from typing import Annotated, Literal

from pydantic import Field

from rig.config.limits_file import AxisLimits, RotaryAxisLimits
from rig.config.model import FileModel, WholeNumber


class TranslationLimits(AxisLimits):
    """Limits of an axis that translates."""

    motion: Literal["translation"]
    tare_span_stop_m: float = Field(gt=0, le=0.5)  # motion beyond which the tare is refused


class RotationLimits(RotaryAxisLimits):
    """Limits of an axis that rotates."""

    motion: Literal["rotation"]
    tare_span_stop_rad: float = Field(gt=0, le=1)  # motion beyond which the tare is refused


class LoopLimits(FileModel):
    """Limits of the loop and of the panel."""

    lost_ticks_stop: WholeNumber = Field(ge=1, le=100_000)  # in one gap
    panel_age_stop_s: float = Field(gt=0, le=60)  # age of the emergency stop's value that stops


AnyAxisLimits = Annotated[TranslationLimits | RotationLimits, Field(discriminator="motion")]


class LimitsFile(FileModel):
    """All limits of a modular rig, besides those of its sensors, which are in the rig file."""

    axes: dict[str, AnyAxisLimits] = Field(min_length=1)  # by the names of the rig file
    loop: LoopLimits
