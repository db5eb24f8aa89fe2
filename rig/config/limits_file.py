"""The limits of a WaveBot. None has a default: who forgets one gets a refused file."""

from collections.abc import Iterator

from pydantic import Field

from rig.config.model import Broken, FileModel, Whole
from rig.config.problems import number_text


class AxisLimits(FileModel):
    """Limits of one powered axis; `warn` is told, `stop` stops."""

    position_warn_m: float = Field(gt=0, le=2)
    position_stop_m: float = Field(gt=0, le=2)
    velocity_stop_m_per_s: float = Field(gt=0, le=10)
    current_peak_a: float = Field(gt=0, le=500)
    current_rms_a: float = Field(gt=0, le=500)
    current_rms_time_s: float = Field(ge=0.1, le=600)
    force_slew_n_per_s: float = Field(gt=0, le=1e7)
    encoder_age_stop_s: float = Field(gt=0, le=1)
    encoder_jump_stop_m: float = Field(gt=0, le=1)
    drive_age_stop_s: float = Field(gt=0, le=5)
    current_difference_stop_a: float = Field(gt=0, le=500)  # between measured and commanded
    current_difference_time_s: float = Field(gt=0, le=60)  # for so long

    def broken_rules(self) -> Iterator[Broken]:
        """A warning before the stop, a mean square below the peak, old values before wrong ones."""
        if self.position_warn_m >= self.position_stop_m:
            yield Broken(
                ("position_warn_m",),
                f"{number_text(self.position_warn_m)} warns no earlier than the stop; "
                f"allowed below position_stop_m = {number_text(self.position_stop_m)} m",
                self.position_warn_m,
            )
        if self.current_rms_a > self.current_peak_a:
            yield Broken(
                ("current_rms_a",),
                f"{number_text(self.current_rms_a)} is more than the peak; "
                f"allowed up to current_peak_a = {number_text(self.current_peak_a)} A",
                self.current_rms_a,
            )
        yield from before_old_values(self, "current_difference_time_s", "drive_age_stop_s")


def before_old_values(limits: FileModel, difference: str, age: str) -> Iterator[Broken]:
    """The broken rule where a value may differ for no longer than it may be old, by both keys."""
    differs, old = getattr(limits, difference), getattr(limits, age)
    if differs <= old:
        yield Broken(
            (difference,),
            f"{number_text(differs)} would stop for a value that is merely old; "
            f"allowed above {age} = {number_text(old)} s",
            differs,
        )


class HeaveLimits(AxisLimits):
    """Limits of the heave axis, which has a second position sensor."""

    string_pot_difference_stop_m: float = Field(gt=0, le=1)


class BusLimits(FileModel):
    """Limits of the heave drive's DC bus."""

    voltage_stop_v: float = Field(gt=0, le=1000)


class MotorPowerLimits(FileModel):
    """What the power of a motor may come to, averaged over a time."""

    time_s: float = Field(ge=0.1, le=600)
    fed_stop_w: float = Field(gt=0, le=1e6)  # into the body, by a law that can only absorb
    motor_difference_stop_w: float = Field(gt=0, le=1e6)  # by its current and by a force sensor
    motor_difference_ratio: float = Field(ge=0, le=10)  # and so much of the force sensor's power


class PowerLimits(MotorPowerLimits):
    """The same with the stations beyond the motor, averaged over a longer time."""

    balance_time_s: float = Field(ge=0.1, le=600)
    balance_stop_w: float = Field(gt=0, le=1e6)  # torque sensor to column load cell, and to AC
    friction_n_s_per_m: float = Field(ge=0, le=1e6)  # and so much loss on the way to the load cell
    loss_w_per_a2: float = Field(ge=0, le=1e3)  # and so much loss on the way to AC


class SpringLimits(FileModel):
    """Limits of the magnetic spring."""

    rotor_travel_stop_m: float = Field(gt=0, le=2)  # of heave, either way from the zero
    stator_age_stop_s: float = Field(gt=0, le=60)


class TareLimits(FileModel):
    """When the tare is refused."""

    position_span_stop_m: float = Field(gt=0, le=0.5)


class LoopLimits(FileModel):
    """Limits of the loop and of the instruments that every rig reads beside its drives."""

    lost_ticks_stop: Whole = Field(ge=1, le=100_000)  # in one gap
    load_cell_age_stop_s: float = Field(gt=0, le=60)
    panel_age_stop_s: float = Field(gt=0, le=60)


class WaveBotLoopLimits(LoopLimits):
    """The same with the power analyser."""

    analyser_age_stop_s: float = Field(gt=0, le=60)


class LimitsFile(FileModel):
    """Every limit of a WaveBot."""

    heave: HeaveLimits
    surge: AxisLimits
    bus: BusLimits
    power: PowerLimits
    spring: SpringLimits
    tare: TareLimits
    loop: WaveBotLoopLimits
