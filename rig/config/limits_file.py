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

    def broken_rules(self) -> Iterator[Broken]:
        """A warning comes before the stop; a mean square cannot exceed the peak."""
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


class HeaveLimits(AxisLimits):
    """Limits of the heave axis, which has a second position sensor."""

    string_pot_difference_stop_m: float = Field(gt=0, le=1)


class BusLimits(FileModel):
    """Limits of the heave drive's DC bus."""

    voltage_stop_v: float = Field(gt=0, le=1000)


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
    spring: SpringLimits
    tare: TareLimits
    loop: WaveBotLoopLimits
