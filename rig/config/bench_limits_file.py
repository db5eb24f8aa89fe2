"""The limits of an OSWEC bench. None has a default: who forgets one gets a refused file."""

from collections.abc import Iterator

from pydantic import Field

from rig.config.limits_file import LoopLimits, MotorPowerLimits, before_old_values
from rig.config.model import Broken, FileModel
from rig.config.problems import number_text


class MotorLimits(FileModel):
    """Limits of motor and drive, told at the gearbox output; `warn` is told, `stop` stops."""

    angle_warn_deg: float = Field(gt=0, le=720)
    angle_stop_deg: float = Field(gt=0, le=720)
    velocity_stop_rad_per_s: float = Field(gt=0, le=50)
    velocity_command_rad_per_s: float = Field(gt=0, le=50)  # the most that is ever commanded
    acceleration_rad_per_s2: float = Field(gt=0, le=1e4)  # of the velocity command
    current_peak_a: float = Field(gt=0, le=100)
    current_rms_a: float = Field(gt=0, le=100)
    current_rms_time_s: float = Field(ge=0.1, le=600)
    current_slew_a_per_s: float = Field(gt=0, le=1e6)
    encoder_age_stop_s: float = Field(gt=0, le=1)
    encoder_jump_stop_deg: float = Field(gt=0, le=90)
    drive_age_stop_s: float = Field(gt=0, le=5)
    current_difference_stop_a: float = Field(gt=0, le=100)  # torque loop: measured to commanded
    current_difference_time_s: float = Field(gt=0, le=60)  # for so long
    velocity_difference_stop_rad_per_s: float = Field(gt=0, le=50)  # velocity loop: the same
    velocity_difference_time_s: float = Field(gt=0, le=60)

    def broken_rules(self) -> Iterator[Broken]:
        """A warning comes before the stop, a command stays below it, a mean below its peak."""
        for lower, upper, unit in (
            ("angle_warn_deg", "angle_stop_deg", "deg"),
            ("velocity_command_rad_per_s", "velocity_stop_rad_per_s", "rad/s"),
        ):
            low, high = getattr(self, lower), getattr(self, upper)
            if low >= high:
                yield Broken(
                    (lower,),
                    f"{number_text(low)} is no less than the stop; "
                    f"allowed below {upper} = {number_text(high)} {unit}",
                    low,
                )
        if self.current_rms_a > self.current_peak_a:
            yield Broken(
                ("current_rms_a",),
                f"{number_text(self.current_rms_a)} is more than the peak; "
                f"allowed up to current_peak_a = {number_text(self.current_peak_a)} A",
                self.current_rms_a,
            )
        yield from before_old_values(self, "current_difference_time_s", "drive_age_stop_s")
        yield from before_old_values(self, "velocity_difference_time_s", "encoder_age_stop_s")


class ShaftLimits(FileModel):
    """Limits of the encoder behind the coupling."""

    encoder_jump_stop_deg: float = Field(gt=0, le=90)
    slip_stop_deg: float = Field(gt=0, le=90)  # between motor and shaft


class LoadCellLimits(FileModel):
    """Range of the load cell, either way."""

    across_stop_n: float = Field(gt=0, le=1e5)  # fx, fy
    along_stop_n: float = Field(gt=0, le=1e5)  # fz
    bending_stop_n_m: float = Field(gt=0, le=1e4)  # tx, ty
    twisting_stop_n_m: float = Field(gt=0, le=1e4)  # tz, about the shaft


class BrakeLimits(FileModel):
    """When the brake counts as lost."""

    difference_stop_a: float = Field(gt=0, le=20)  # between told and measured current
    difference_time_s: float = Field(gt=0, le=60)  # for so long
    age_stop_s: float = Field(gt=0, le=60)


class Authority(FileModel):
    """The most that feedback may add to what is asked, either way."""

    angle_deg: float = Field(gt=0, le=10)  # of the position correction in the instant
    velocity_rad_per_s: float = Field(gt=0, le=10)  # of the same
    torque_n_m: float = Field(gt=0, le=1000)  # of the torque loop


class BenchTareLimits(FileModel):
    """When the tare is refused."""

    angle_span_stop_deg: float = Field(gt=0, le=45)


class BenchLimitsFile(FileModel):
    """Every limit of an OSWEC bench."""

    motor: MotorLimits
    shaft: ShaftLimits
    load_cell: LoadCellLimits
    brake: BrakeLimits
    power: MotorPowerLimits
    authority: Authority
    tare: BenchTareLimits
    loop: LoopLimits
