"""Limits that every kind of rig has, and limits of runs that are older than a check."""

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

from pydantic import Field

from rig.config.model import FileModel, RuleViolation, WholeNumber
from rig.config.problems import format_number


class MotorPowerLimits(FileModel):
    """Limits of a motor's power, averaged over a time."""

    time_s: float = Field(ge=0.1, le=600)  # of the average
    fed_stop_w: float = Field(gt=0, le=1e6)  # into the body, by a law that can only absorb
    # between the power from the motor's current and the power from a force sensor
    motor_difference_stop_w: float = Field(gt=0, le=1e6)
    """Difference between both powers that stops."""
    motor_difference_ratio: float = Field(ge=0, le=10)  # added share of the force sensor's power


class LoopLimits(FileModel):
    """Limits of the loop, and of load cell and panel."""

    lost_ticks_stop: WholeNumber = Field(ge=1, le=100_000)  # in one gap
    load_cell_age_stop_s: float = Field(gt=0, le=60)  # age of the values that stops
    panel_age_stop_s: float = Field(gt=0, le=60)  # age of the emergency stop's value that stops


class DriveLimits(FileModel):
    """Limits of the drive and the encoder of a powered axis."""

    current_peak_a: float = Field(gt=0, le=500)  # limit of the commanded current
    current_rms_a: float = Field(gt=0, le=500)  # limit of its root mean square
    current_rms_time_s: float = Field(ge=0.1, le=600)  # time of the root mean square
    encoder_age_stop_s: float = Field(gt=0, le=1)  # age of the encoder's value that stops
    drive_age_stop_s: float = Field(gt=0, le=5)  # age of the drive's values that stops
    current_difference_stop_a: float = Field(gt=0, le=500)  # between measured and commanded
    current_difference_time_s: float = Field(gt=0, le=60)  # for at least this time

    unit: ClassVar[str] = ""  # of the position, in the keys

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check the order of rms and peak, of stale and wrong values, and of warning and stop."""
        if self.unit:
            yield from _check_warning(self, self.unit)
        if self.current_rms_a > self.current_peak_a:
            yield self.violation(
                "current_rms_a",
                f"{format_number(self.current_rms_a)} is more than the peak; "
                f"allowed up to current_peak_a = {format_number(self.current_peak_a)} A",
            )
        yield from check_difference_time(self, "current_difference_time_s", "drive_age_stop_s")


class AxisLimits(DriveLimits):
    """Limits of an axis that translates; `warn` gives a warning, `stop` stops the rig."""

    unit = "m"

    position_warn_m: float = Field(gt=0, le=2)  # distance from zero that gives an alarm
    position_stop_m: float = Field(gt=0, le=2)  # distance from zero that stops
    velocity_stop_m_per_s: float = Field(gt=0, le=10)  # speed that stops
    force_slew_n_per_s: float = Field(gt=0, le=1e7)  # limit of the change of the commanded force
    encoder_jump_stop_m: float = Field(gt=0, le=1)  # step between two readings that stops


class RotaryAxisLimits(DriveLimits):
    """Limits of an axis that rotates; `warn` gives a warning, `stop` stops the rig."""

    unit = "rad"

    position_warn_rad: float = Field(gt=0, le=100)  # angle from zero that gives an alarm
    position_stop_rad: float = Field(gt=0, le=100)  # angle from zero that stops
    velocity_stop_rad_per_s: float = Field(gt=0, le=100)  # speed that stops
    torque_slew_n_m_per_s: float = Field(gt=0, le=1e7)
    """Limit of the change of the commanded torque."""
    encoder_jump_stop_rad: float = Field(gt=0, le=10)  # step between two readings that stops


def _check_warning(limits: FileModel, unit: str) -> Iterator[RuleViolation]:
    warn, stop = (getattr(limits, f"position_{level}_{unit}") for level in ("warn", "stop"))
    if warn >= stop:
        yield limits.violation(
            f"position_warn_{unit}",
            f"{format_number(warn)} warns no earlier than the stop; "
            f"allowed below position_stop_{unit} = {format_number(stop)} {unit}",
        )


def check_difference_time(limits: FileModel, difference: str, age: str) -> Iterator[RuleViolation]:
    """Yield a violation unless the key ``difference`` (time) exceeds the key ``age`` (maximum age).

    Otherwise a value that is merely stale would stop the rig as a wrong one.
    """
    difference_time, max_age = getattr(limits, difference), getattr(limits, age)
    if difference_time <= max_age:
        yield limits.violation(
            difference,
            f"{format_number(difference_time)} would stop for a value that is merely old; "
            f"allowed above {age} = {format_number(max_age)} s",
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
