"""The limits of a WaveBot. No limit has a default: a file without one of them is refused."""

from pydantic import Field

from rig.config.limits_file import (
    NO_MOTOR_POWER_CHECK,
    AxisLimits,
    LoopLimits,
    MotorPowerLimits,
)
from rig.config.model import FileModel


class HeaveLimits(AxisLimits):
    """Limits of the heave axis, which has a second position sensor."""

    string_pot_difference_stop_m: float = Field(gt=0, le=1)
    """Difference from the encoder that stops."""


class BusLimits(FileModel):
    """Limits of the heave drive's DC bus."""

    voltage_stop_v: float = Field(gt=0, le=1000)  # voltage that stops


class PowerLimits(MotorPowerLimits):
    """Power limits of the motor and of the stations beyond it, averaged over a longer time."""

    balance_time_s: float = Field(ge=0.1, le=600)  # of the average
    balance_stop_w: float = Field(gt=0, le=1e6)  # torque sensor to column load cell, and to AC
    friction_n_s_per_m: float = Field(ge=0, le=1e6)  # allowed loss up to the load cell
    loss_w_per_a2: float = Field(ge=0, le=1e3)  # allowed loss up to AC


class SpringLimits(FileModel):
    """Limits of the magnetic spring."""

    rotor_travel_stop_m: float = Field(gt=0, le=2)  # of heave, either way from the zero
    stator_age_stop_s: float = Field(gt=0, le=60)  # age of the position that stops


class TareLimits(FileModel):
    """Limits beyond which the tare is refused."""

    position_span_stop_m: float = Field(gt=0, le=0.5)  # motion during the tare that stops


class WaveBotLoopLimits(LoopLimits):
    """Limits of the loop and the instruments of a WaveBot, with its power analyser."""

    analyser_age_stop_s: float = Field(gt=0, le=60)  # age of the values that stops


class LimitsFile(FileModel):
    """All limits of a WaveBot."""

    heave: HeaveLimits
    surge: AxisLimits
    bus: BusLimits
    power: PowerLimits
    spring: SpringLimits
    tare: TareLimits
    loop: WaveBotLoopLimits


_NO_CURRENT_CHECK = {"current_difference_stop_a": 500.0, "current_difference_time_s": 60.0}
LATER_LIMITS: dict[str, dict[str, float]] = {
    "heave": _NO_CURRENT_CHECK,
    "surge": _NO_CURRENT_CHECK,
    "power": {
        **NO_MOTOR_POWER_CHECK,
        "balance_time_s": 600.0,
        "balance_stop_w": 1e6,
        "friction_n_s_per_m": 1e6,
        "loss_w_per_a2": 1e3,
    },
}
"""Limits of checks that runs recorded earlier did not have; they never trip."""
