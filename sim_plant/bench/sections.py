"""The sections of a bench's plant file."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from sim_plant.entries import (
    Count,
    Entry,
    NonNegative,
    Positive,
    Stiffness,
    StrictModel,
    TableRow,
    Time,
)

Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
SwitchValue = Annotated[int, Field(ge=0, le=1)]
Angle = Annotated[float, Field(ge=0.0, le=10.0)]  # deg
Level = Annotated[float, Field(ge=-1.0e3, le=1.0e3)]
SixAxes = Annotated[tuple[Level, Level, Level, Level, Level, Level], Field(strict=False)]
Matrix = Annotated[tuple[SixAxes, SixAxes, SixAxes, SixAxes, SixAxes, SixAxes], Field(strict=False)]


class Drive(StrictModel):
    """Command side of the servo drive."""

    current_limit: Entry[Positive, Literal["A"]]
    current_time_constant: Entry[Annotated[float, Field(gt=0.0, le=0.001)], Literal["s"]]
    enable_delay: Entry[Time, Literal["s"]]
    watchdog: Entry[Time, Literal["s"]]


class VelocityLoop(StrictModel):
    """Velocity loop and its analog input; at the gearbox output."""

    gain: Entry[Positive, Literal["rad/s/V"]]
    offset: Entry[Annotated[float, Field(ge=-1.0, le=1.0)], Literal["V"]]
    range: Entry[Annotated[float, Field(gt=0.0, le=10.0)], Literal["V"]]
    resolution: Entry[Annotated[float, Field(ge=0.0, le=0.1)], Literal["V"]]
    time_constant: Entry[Annotated[float, Field(gt=0.0, le=1.0)], Literal["s"]]
    cut_in: Entry[Annotated[float, Field(ge=0.0, le=1.0)], Literal["rad/s"]]
    cut_in_spread: Entry[Fraction, Literal["1"]]
    cut_in_closing: Entry[Time, Literal["s"]]
    droop: Entry[Annotated[float, Field(ge=0.0, le=1.0)], Literal["rad/s"]]
    droop_speed: Entry[Positive, Literal["rad/s"]]
    tuned_load: Entry[Positive, Literal["N m"]]
    load_window: Entry[Time, Literal["s"]]


class Motor(StrictModel):
    """Motor and rotor."""

    torque_constant: Entry[Positive, Literal["N m/A"]]
    gear_ratio: Entry[Positive, Literal["1"]]
    inertia: Entry[Annotated[float, Field(gt=0.0, le=1.0)], Literal["kg m2"]]
    viscous: Entry[NonNegative, Literal["N m s/rad"]]
    top_speed: Entry[Positive, Literal["rev/s"]]


class Gearbox(StrictModel):
    """Friction of the gearbox at its output."""

    dry: Entry[NonNegative, Literal["N m"]]
    breakaway: Entry[NonNegative, Literal["N m"]]
    settling: Entry[Annotated[float, Field(gt=0.0, le=10.0)], Literal["deg"]]
    share_forward: Entry[Fraction, Literal["1"]]
    share_back: Entry[Fraction, Literal["1"]]
    spread_forward: Entry[Fraction, Literal["1"]]
    spread_back: Entry[Fraction, Literal["1"]]


class Transmission(StrictModel):
    """Stiffnesses in series, gap, and settling of the gearbox."""

    gearbox_stiffness: Entry[Stiffness, Literal["N m/rad"]]
    coupling_stiffness: Entry[Stiffness, Literal["N m/rad"]]
    shaft_shear_modulus: Entry[Annotated[float, Field(gt=0.0, le=1.0e12)], Literal["Pa"]]
    shaft_diameter: Entry[Annotated[float, Field(gt=0.0, le=1.0)], Literal["m"]]
    shaft_length: Entry[Annotated[float, Field(gt=0.0, le=10.0)], Literal["m"]]
    half_gap: Entry[Angle, Literal["deg"]]
    soft_deflection: Entry[Angle, Literal["deg"]]
    soft_torque: Entry[Positive, Literal["N m"]]


class Drag(StrictModel):
    """Friction of a bearing or a seal."""

    clockwise: Entry[NonNegative, Literal["N m"]]
    counter: Entry[NonNegative, Literal["N m"]]
    viscous: Entry[NonNegative, Literal["N m s/rad"]]


class Brake(StrictModel):
    """Particle brake and its amplifier."""

    fitted: Entry[SwitchValue, Literal["0 or 1"]]
    currents: Entry[TableRow, Literal["A"]]
    torques: Entry[TableRow, Literal["N m"]]
    half_width: Entry[Annotated[float, Field(ge=0.0, le=1.0)], Literal["A"]]
    current_limit: Entry[Positive, Literal["A"]]
    current_lag: Entry[Time, Literal["s"]]
    torque_lag: Entry[Time, Literal["s"]]

    @model_validator(mode="after")
    def _check_curve(self) -> Brake:
        currents, torques = self.currents.value, self.torques.value
        if len(currents) != len(torques):
            raise ValueError(f"{len(currents)} brake currents but {len(torques)} torques")
        if currents[0] != 0.0 or any(b <= a for a, b in pairwise(currents)):
            raise ValueError("brake currents must ascend from 0")
        if torques[0] < 0.0 or any(b < a for a, b in pairwise(torques)):
            raise ValueError("brake torques must not fall, nor be negative")
        return self


class LoadCell(StrictModel):
    """Six-axis load cell; noise is the standard deviation of one sample."""

    cross_talk: Entry[Matrix, Literal["SI, fx fy fz tx ty tz by row"]]
    weight: Entry[NonNegative, Literal["N"]]
    weight_arm: Entry[Annotated[float, Field(ge=0.0, le=10.0)], Literal["m"]]
    misalignment: Entry[Fraction, Literal["1"]]
    bias: Entry[SixAxes, Literal["SI, fx fy fz tx ty tz"]]
    drift: Entry[SixAxes, Literal["SI, fx fy fz tx ty tz"]]
    drift_time: Entry[Annotated[float, Field(gt=0.0, le=1.0e6)], Literal["s"]]
    force_noise: Entry[NonNegative, Literal["N"]]
    torque_noise: Entry[NonNegative, Literal["N m"]]
    force_resolution: Entry[NonNegative, Literal["N"]]
    torque_resolution: Entry[NonNegative, Literal["N m"]]


class Sensors(StrictModel):
    """Encoders, currents and the limit switch."""

    delay_ticks: Entry[Annotated[int, Field(ge=0, le=20)], Literal["tick"]]
    motor_counts: Entry[Annotated[int, Field(ge=100, le=100_000_000)], Literal["count/rev"]]
    motor_offset: Entry[Count, Literal["count"]]
    shaft_counts: Entry[Annotated[int, Field(ge=100, le=100_000_000)], Literal["count/rev"]]
    shaft_offset: Entry[Count, Literal["count"]]
    current_noise: Entry[NonNegative, Literal["A"]]
    current_resolution: Entry[NonNegative, Literal["A"]]
    brake_current_noise: Entry[NonNegative, Literal["A"]]
    brake_current_resolution: Entry[NonNegative, Literal["A"]]
    travel: Entry[Annotated[float, Field(gt=0.0, le=360.0)], Literal["deg"]]
