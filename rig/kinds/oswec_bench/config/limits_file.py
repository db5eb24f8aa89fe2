"""The limits of an OSWEC bench. No limit has a default: a file without one of them is refused."""

from collections.abc import Iterator

from pydantic import Field

from rig.config.limits_file import (
    NO_MOTOR_POWER_CHECK,
    DriveLimits,
    LoopLimits,
    MotorPowerLimits,
    check_difference_time,
)
from rig.config.model import FileModel, RuleViolation
from rig.config.problems import format_number


class MotorLimits(DriveLimits):
    """Limits of motor and drive at the gearbox output; `warn` gives a warning, `stop` stops."""

    angle_warn_deg: float = Field(gt=0, le=720)  # angle from zero that gives an alarm
    angle_stop_deg: float = Field(gt=0, le=720)  # angle from zero that stops
    velocity_stop_rad_per_s: float = Field(gt=0, le=50)  # speed that stops
    velocity_command_rad_per_s: float = Field(gt=0, le=50)  # maximum command
    acceleration_rad_per_s2: float = Field(gt=0, le=1e4)  # of the velocity command
    current_peak_a: float = Field(gt=0, le=100)  # limit of the commanded current
    current_rms_a: float = Field(gt=0, le=100)  # limit of its root mean square
    current_slew_a_per_s: float = Field(gt=0, le=1e6)
    """Limit of the change of the commanded current."""
    encoder_jump_stop_deg: float = Field(gt=0, le=90)  # step between two readings that stops
    current_difference_stop_a: float = Field(gt=0, le=100)  # in the torque loop
    velocity_difference_stop_rad_per_s: float = Field(gt=0, le=50)  # same, in the velocity loop
    velocity_difference_time_s: float = Field(gt=0, le=60)  # for at least this time

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check the order of warning, command and stop, of rms and peak, of stale and wrong."""
        for lower, upper, unit in (
            ("angle_warn_deg", "angle_stop_deg", "deg"),
            ("velocity_command_rad_per_s", "velocity_stop_rad_per_s", "rad/s"),
        ):
            low, high = getattr(self, lower), getattr(self, upper)
            if low >= high:
                yield RuleViolation(
                    (lower,),
                    f"{format_number(low)} is not below the stop; "
                    f"allowed below {upper} = {format_number(high)} {unit}",
                    low,
                )
        yield from super().check_rules()
        yield from check_difference_time(self, "velocity_difference_time_s", "encoder_age_stop_s")


class ShaftLimits(FileModel):
    """Limits of the encoder behind the coupling."""

    encoder_jump_stop_deg: float = Field(gt=0, le=90)  # step between two readings that stops
    slip_stop_deg: float = Field(gt=0, le=90)  # between motor and shaft


class LoadCellLimits(FileModel):
    """Limits of the load cell, for both signs."""

    across_stop_n: float = Field(gt=0, le=1e5)  # fx, fy
    along_stop_n: float = Field(gt=0, le=1e5)  # fz
    bending_stop_n_m: float = Field(gt=0, le=1e4)  # tx, ty
    twisting_stop_n_m: float = Field(gt=0, le=1e4)  # tz, about the shaft


class BrakeLimits(FileModel):
    """Limits beyond which the brake counts as lost."""

    difference_stop_a: float = Field(gt=0, le=20)  # between commanded and measured current
    difference_time_s: float = Field(gt=0, le=60)  # for at least this time
    age_stop_s: float = Field(gt=0, le=60)  # age of the brake's current that stops


class FeedbackAuthority(FileModel):
    """Maximum contribution of feedback to the demand, for both signs."""

    angle_deg: float = Field(gt=0, le=10)  # of the instantaneous position correction
    velocity_rad_per_s: float = Field(gt=0, le=10)  # of the same correction
    torque_n_m: float = Field(gt=0, le=1000)  # of the torque loop


class BenchTareLimits(FileModel):
    """Limits beyond which the tare is refused."""

    angle_span_stop_deg: float = Field(gt=0, le=45)  # motion during the tare that stops


class BenchLimitsFile(FileModel):
    """All limits of an OSWEC bench."""

    motor: MotorLimits
    shaft: ShaftLimits
    load_cell: LoadCellLimits
    brake: BrakeLimits
    power: MotorPowerLimits
    authority: FeedbackAuthority
    tare: BenchTareLimits
    loop: LoopLimits


LATER_LIMITS: dict[str, dict[str, float]] = {
    "motor": {
        "current_difference_stop_a": 100.0,
        "current_difference_time_s": 60.0,
        "velocity_difference_stop_rad_per_s": 50.0,
        "velocity_difference_time_s": 60.0,
    },
    "power": NO_MOTOR_POWER_CHECK,
}
"""Limits of checks that runs recorded earlier did not have; they never trip."""
