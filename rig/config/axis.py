"""A powered axis in a rig file: motor, gear, encoder and estimator."""

from pydantic import Field

from rig.config.model import FileModel, WholeNumber


class Motor(FileModel):
    """What every powered axis has, whether it translates or rotates."""

    torque_constant_n_m_per_a: float = Field(ge=0.01, le=100)
    counts_per_revolution: WholeNumber = Field(ge=100, le=100_000_000)
    encoder_noise_counts: float = Field(ge=0, le=1000)  # standard deviation, without quantisation
    gain_ramp_s: float = Field(ge=0, le=10)


class Axis(Motor):
    """Drive, encoder and estimator of an axis that translates."""

    gear_ratio_rad_per_m: float = Field(ge=0.1, le=1000)
    jerk_density_m2_per_s5: float = Field(ge=1e-4, le=1e6)


class RotaryAxis(Motor):
    """Drive, encoder and estimator of an axis that rotates."""

    gear_ratio: float = Field(ge=0.1, le=1000)  # rad of the motor per rad of the axis
    jerk_density_rad2_per_s5: float = Field(ge=1e-4, le=1e6)
