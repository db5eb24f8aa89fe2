"""The sections of a bench's plant file."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from sim_plant.entries import Checked, Count, Entry, Positive, Row, Size, Stiffness, Time

Share = Annotated[float, Field(ge=0.0, le=1.0)]
Switch = Annotated[int, Field(ge=0, le=1)]
Angle = Annotated[float, Field(ge=0.0, le=10.0)]  # deg
Level = Annotated[float, Field(ge=-1.0e3, le=1.0e3)]
Six = Annotated[tuple[Level, Level, Level, Level, Level, Level], Field(strict=False)]
Matrix = Annotated[tuple[Six, Six, Six, Six, Six, Six], Field(strict=False)]


class Drive(Checked):
    """Command side of the servo drive."""

    current_limit: Entry[Positive, Literal["A"]]
    current_time_constant: Entry[Annotated[float, Field(gt=0.0, le=0.001)], Literal["s"]]
    enable_delay: Entry[Time, Literal["s"]]
    watchdog: Entry[Time, Literal["s"]]


class VelocityLoop(Checked):
    """Velocity loop and its analog input; at the gearbox output."""

    gain: Entry[Positive, Literal["rad/s/V"]]
    offset: Entry[Annotated[float, Field(ge=-1.0, le=1.0)], Literal["V"]]
    range: Entry[Annotated[float, Field(gt=0.0, le=10.0)], Literal["V"]]
    resolution: Entry[Annotated[float, Field(ge=0.0, le=0.1)], Literal["V"]]
    time_constant: Entry[Annotated[float, Field(gt=0.0, le=1.0)], Literal["s"]]
    cut_in: Entry[Annotated[float, Field(ge=0.0, le=1.0)], Literal["rad/s"]]
    cut_in_spread: Entry[Share, Literal["1"]]
    cut_in_closing: Entry[Time, Literal["s"]]
    droop: Entry[Annotated[float, Field(ge=0.0, le=1.0)], Literal["rad/s"]]
    droop_speed: Entry[Positive, Literal["rad/s"]]
    tuned_load: Entry[Positive, Literal["N m"]]
    load_window: Entry[Time, Literal["s"]]


class Motor(Checked):
    """Motor and rotor."""

    torque_constant: Entry[Positive, Literal["N m/A"]]
    gear_ratio: Entry[Positive, Literal["1"]]
    inertia: Entry[Annotated[float, Field(gt=0.0, le=1.0)], Literal["kg m2"]]
    viscous: Entry[Size, Literal["N m s/rad"]]
    top_speed: Entry[Positive, Literal["rev/s"]]


class Gearbox(Checked):
    """Friction of the gearbox at its output."""

    dry: Entry[Size, Literal["N m"]]
    breakaway: Entry[Size, Literal["N m"]]
    settling: Entry[Annotated[float, Field(gt=0.0, le=10.0)], Literal["deg"]]
    share_forward: Entry[Share, Literal["1"]]
    share_back: Entry[Share, Literal["1"]]
    spread_forward: Entry[Share, Literal["1"]]
    spread_back: Entry[Share, Literal["1"]]


class Transmission(Checked):
    """Stiffnesses in series, gap, and how the gearbox settles."""

    gearbox_stiffness: Entry[Stiffness, Literal["N m/rad"]]
    coupling_stiffness: Entry[Stiffness, Literal["N m/rad"]]
    shaft_shear_modulus: Entry[Annotated[float, Field(gt=0.0, le=1.0e12)], Literal["Pa"]]
    shaft_diameter: Entry[Annotated[float, Field(gt=0.0, le=1.0)], Literal["m"]]
    shaft_length: Entry[Annotated[float, Field(gt=0.0, le=10.0)], Literal["m"]]
    half_gap: Entry[Angle, Literal["deg"]]
    soft_deflection: Entry[Angle, Literal["deg"]]
    soft_torque: Entry[Positive, Literal["N m"]]


class Drag(Checked):
    """Friction of a bearing or a seal."""

    clockwise: Entry[Size, Literal["N m"]]
    counter: Entry[Size, Literal["N m"]]
    viscous: Entry[Size, Literal["N m s/rad"]]


class Brake(Checked):
    """Particle brake and its amplifier."""

    fitted: Entry[Switch, Literal["0 or 1"]]
    currents: Entry[Row, Literal["A"]]
    torques: Entry[Row, Literal["N m"]]
    half_width: Entry[Annotated[float, Field(ge=0.0, le=1.0)], Literal["A"]]
    current_limit: Entry[Positive, Literal["A"]]
    current_lag: Entry[Time, Literal["s"]]
    torque_lag: Entry[Time, Literal["s"]]

    @model_validator(mode="after")
    def _is_a_curve(self) -> Brake:
        currents, torques = self.currents.value, self.torques.value
        if len(currents) != len(torques):
            raise ValueError(f"{len(currents)} brake currents but {len(torques)} torques")
        if currents[0] != 0.0 or any(b <= a for a, b in pairwise(currents)):
            raise ValueError("brake currents must ascend from 0")
        if torques[0] < 0.0 or any(b < a for a, b in pairwise(torques)):
            raise ValueError("brake torques must not fall, nor be negative")
        return self


class LoadCell(Checked):
    """Six-axis load cell; noise is the standard deviation of one sample."""

    cross_talk: Entry[Matrix, Literal["SI, fx fy fz tx ty tz by row"]]
    weight: Entry[Size, Literal["N"]]
    weight_arm: Entry[Annotated[float, Field(ge=0.0, le=10.0)], Literal["m"]]
    misalignment: Entry[Share, Literal["1"]]
    bias: Entry[Six, Literal["SI, fx fy fz tx ty tz"]]
    drift: Entry[Six, Literal["SI, fx fy fz tx ty tz"]]
    drift_time: Entry[Annotated[float, Field(gt=0.0, le=1.0e6)], Literal["s"]]
    force_noise: Entry[Size, Literal["N"]]
    torque_noise: Entry[Size, Literal["N m"]]
    force_resolution: Entry[Size, Literal["N"]]
    torque_resolution: Entry[Size, Literal["N m"]]


class Sensors(Checked):
    """Encoders, currents and the limit switch."""

    delay_ticks: Entry[Annotated[int, Field(ge=0, le=20)], Literal["tick"]]
    motor_counts: Entry[Annotated[int, Field(ge=100, le=100_000_000)], Literal["count/rev"]]
    motor_offset: Entry[Count, Literal["count"]]
    shaft_counts: Entry[Annotated[int, Field(ge=100, le=100_000_000)], Literal["count/rev"]]
    shaft_offset: Entry[Count, Literal["count"]]
    current_noise: Entry[Size, Literal["A"]]
    current_resolution: Entry[Size, Literal["A"]]
    brake_current_noise: Entry[Size, Literal["A"]]
    brake_current_resolution: Entry[Size, Literal["A"]]
    travel: Entry[Annotated[float, Field(gt=0.0, le=360.0)], Literal["deg"]]
