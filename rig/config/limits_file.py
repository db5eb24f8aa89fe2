"""Limits that every kind of rig has, and limits of runs that are older than a check."""

from collections.abc import Iterator, Mapping
from typing import Any

from pydantic import Field

from rig.config.model import FileModel, RuleViolation, WholeNumber
from rig.config.problems import format_number


class MotorPowerLimits(FileModel):
    """Limits of a motor's power, averaged over a time."""

    time_s: float = Field(ge=0.1, le=600)
    fed_stop_w: float = Field(gt=0, le=1e6)  # into the body, by a law that can only absorb
    # between the power from the motor's current and the power from a force sensor
    motor_difference_stop_w: float = Field(gt=0, le=1e6)
    motor_difference_ratio: float = Field(ge=0, le=10)  # added share of the force sensor's power


class LoopLimits(FileModel):
    """Limits of the loop and of the instruments that every rig has in addition to its drives."""

    lost_ticks_stop: WholeNumber = Field(ge=1, le=100_000)  # in one gap
    load_cell_age_stop_s: float = Field(gt=0, le=60)
    panel_age_stop_s: float = Field(gt=0, le=60)


def check_rms_below_peak(limits: Any) -> Iterator[RuleViolation]:
    """Yield a violation if ``current_rms_a`` exceeds ``current_peak_a``."""
    if limits.current_rms_a > limits.current_peak_a:
        yield RuleViolation(
            ("current_rms_a",),
            f"{format_number(limits.current_rms_a)} is more than the peak; "
            f"allowed up to current_peak_a = {format_number(limits.current_peak_a)} A",
            limits.current_rms_a,
        )


def check_difference_time(limits: FileModel, difference: str, age: str) -> Iterator[RuleViolation]:
    """Yield a violation unless the key ``difference`` (time) exceeds the key ``age`` (maximum age).

    Otherwise a value that is merely stale would stop the rig as a wrong one.
    """
    difference_time, max_age = getattr(limits, difference), getattr(limits, age)
    if difference_time <= max_age:
        yield RuleViolation(
            (difference,),
            f"{format_number(difference_time)} would stop for a value that is merely old; "
            f"allowed above {age} = {format_number(max_age)} s",
            difference_time,
        )


# A limits file has no defaults, and a run recorded before a check existed has no limit for it. Such
# a run is opened and replayed with the weakest value that a file may have. No drive of these rigs
# comes near it, so the check never trips and the replay gives the same result as the run.
NO_MOTOR_POWER_CHECK = {
    "time_s": 600.0,
    "fed_stop_w": 1e6,
    "motor_difference_stop_w": 1e6,
    "motor_difference_ratio": 10.0,
}
"""`MotorPowerLimits` that never trip."""


def complete_limits(
    recorded: Mapping[str, Any], later: Mapping[str, Mapping[str, float]]
) -> dict[str, Any]:
    """Return recorded limits with those of ``later`` checks, by section, where they lack them."""
    sections = {key: {**added, **recorded.get(key, {})} for key, added in later.items()}
    return {**recorded, **sections}
