"""The plant file: every number with its unit, its source and an allowed range.

`Plant.model_validate(mapping)` checks one merged mapping (`extends` is resolved before), and
`Plant.build()` turns it into the NamedTuples of the step. Nothing has a default.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Annotated, Generic, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

from sim_plant.body import BodyParams
from sim_plant.drive import DriveParams
from sim_plant.magnetic_spring import SpringParams
from sim_plant.pto import PtoParams
from sim_plant.sensors import Channel
from sim_plant.wavebot import SensorParams, WaveBotParams

Value = TypeVar("Value")
Unit = TypeVar("Unit")
Text = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]


class Checked(BaseModel):
    """Frozen, strict, no unknown key, no infinity; an int is taken where a float is meant."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)


class Entry(Checked, Generic[Value, Unit]):
    """One number of the plant file: value (in the field's range), its unit, where it comes from."""

    value: Value
    unit: Unit
    source: Text


Row = Annotated[tuple[float, ...], Field(min_length=2, max_length=32, strict=False)]

Inertia = Annotated[float, Field(gt=0.0, le=1.0e6)]
Stiffness = Annotated[float, Field(gt=0.0, le=1.0e7)]
Damping = Annotated[float, Field(ge=0.0, le=1.0e5)]
Size = Annotated[float, Field(ge=0.0, le=1.0e4)]
Positive = Annotated[float, Field(gt=0.0, le=1.0e4)]
Time = Annotated[float, Field(gt=0.0, le=100.0)]
Signed = Annotated[float, Field(ge=-1.0e4, le=1.0e4)]


class Radiation(Checked):
    """Rational fit of the radiation memory, highest power first, leading denominator 1 omitted."""

    numerator: Entry[Row, Literal["SI, s4 to s1"]]
    denominator: Entry[Row, Literal["SI, s4 to s0"]]

    @model_validator(mode="after")
    def _is_passive(self) -> Radiation:
        """Refuse a fit of another order, or one that breaks the high-frequency passivity bound."""
        num, den = self.numerator.value, self.denominator.value
        if len(num) != 4 or len(den) != 5:
            raise ValueError("the radiation fit has 4 numerator and 5 denominator coefficients")
        if den[0] * num[0] < num[1]:
            raise ValueError("the radiation fit is not passive: a(n-1) b(n-1) < b(n-2)")
        return self


class Body(Checked):
    """The floating body in heave."""

    mass: Entry[Inertia, Literal["kg"]]
    added_mass_infinite: Entry[Inertia, Literal["kg"]]
    hydrostatic: Entry[Stiffness, Literal["N/m"]]
    viscous_linear: Entry[Damping, Literal["N s/m"]]
    viscous_quadratic: Entry[Damping, Literal["N s2/m2"]]
    radiation: Radiation


class Pto(Checked):
    """Motor and drivetrain."""

    torque_constant: Entry[Positive, Literal["N m/A"]]
    winding_resistance: Entry[Positive, Literal["ohm"]]
    gear_ratio: Entry[Positive, Literal["rad/m"]]
    drivetrain_viscous: Entry[Damping, Literal["N s/m"]]
    drivetrain_coulomb: Entry[Size, Literal["N"]]
    coulomb_velocity: Entry[Annotated[float, Field(ge=0.001, le=0.1)], Literal["m/s"]]


class Spring(Checked):
    """Magnetic spring: rate over stator position, torque law, share that acts."""

    law: Entry[Literal["sine", "linear"], Literal["1"]]
    spring_effect: Entry[Annotated[float, Field(ge=0.0, le=1.5)], Literal["1"]]
    lever: Entry[Annotated[float, Field(gt=0.0, le=10.0)], Literal["m/rad"]]
    fit_half_angle: Entry[Annotated[float, Field(gt=0.0, lt=1.5)], Literal["rad"]]
    stator_positions: Entry[Row, Literal["%"]]
    spring_rates: Entry[Row, Literal["N/m"]]

    @model_validator(mode="after")
    def _is_a_table(self) -> Spring:
        stations, rates = self.stator_positions.value, self.spring_rates.value
        if len(stations) != len(rates):
            raise ValueError(f"{len(stations)} stator positions but {len(rates)} spring rates")
        if any(b <= a for a, b in pairwise(stations)):
            raise ValueError("stator positions must ascend")
        return self


class Stator(Checked):
    """Stator actuator."""

    speed: Entry[Positive, Literal["m/s"]]
    travel: Entry[Positive, Literal["m per 100 %"]]
    start: Entry[Annotated[float, Field(ge=-100.0, le=100.0)], Literal["%"]]


class Drive(Checked):
    """Commercial drive, DC supply and power analyser."""

    current_limit: Entry[Positive, Literal["A"]]
    current_time_constant: Entry[Annotated[float, Field(ge=1.0e-5, le=0.1)], Literal["s"]]
    enable_delay: Entry[Annotated[float, Field(ge=0.0, le=10.0)], Literal["s"]]
    watchdog: Entry[Time, Literal["s"]]
    fixed_loss: Entry[Size, Literal["W"]]
    linear_loss: Entry[Size, Literal["W/A"]]
    square_loss: Entry[Size, Literal["W/A2"]]
    bus_voltage: Entry[Positive, Literal["V"]]
    bus_resistance: Entry[Size, Literal["ohm"]]
    analyser_window: Entry[Annotated[float, Field(gt=0.0, le=1.0)], Literal["s"]]


class Sensors(Checked):
    """Sensor scales and errors; noise is the standard deviation of one sample."""

    delay_ticks: Entry[Annotated[int, Field(ge=0, le=20)], Literal["tick"]]
    encoder_counts: Entry[Annotated[int, Field(ge=100, le=100_000_000)], Literal["count/rev"]]
    encoder_offset: Entry[Annotated[int, Field(ge=-(10**9), le=10**9)], Literal["count"]]
    current_noise: Entry[Size, Literal["A"]]
    current_resolution: Entry[Size, Literal["A"]]
    string_pot_bias: Entry[Signed, Literal["m"]]
    string_pot_noise: Entry[Size, Literal["m"]]
    string_pot_resolution: Entry[Size, Literal["m"]]
    lcb_bias: Entry[Signed, Literal["N"]]
    lcb_noise: Entry[Size, Literal["N"]]
    trs_bias: Entry[Signed, Literal["N"]]
    trs_noise: Entry[Size, Literal["N"]]
    force_resolution: Entry[Size, Literal["N"]]
    rotor_noise: Entry[Size, Literal["rad"]]


class Waves(Checked):
    """Wave maker."""

    onset: Entry[Annotated[float, Field(ge=0.0, le=100.0)], Literal["s"]]


class Plant(Checked):
    """A whole plant file; `bem` is a file name beside it."""

    name: Text
    bem: Text
    body: Body
    pto: Pto
    spring: Spring
    stator: Stator
    drive: Drive
    sensors: Sensors
    waves: Waves

    @model_validator(mode="after")
    def _starts_on_the_table(self) -> Plant:
        stations, start = self.spring.stator_positions.value, self.stator.start.value
        if not stations[0] <= start <= stations[-1]:
            raise ValueError(f"stator start {start} % is outside the spring table")
        return self

    def build(self) -> WaveBotParams:
        """Give the constants of the step as real floats."""
        return WaveBotParams(
            _body(self.body),
            _pto(self.pto),
            _spring(self.spring, self.stator),
            _drive(self.drive),
            _sensors(self.sensors, self.pto.gear_ratio.value),
        )


def fit_slope(half_angle: float) -> float:
    """Give the least-squares slope of sin 2 theta over ±half_angle (rad): 1.649 at 39.27 deg."""
    arch = 0.5 * math.sin(2.0 * half_angle) - half_angle * math.cos(2.0 * half_angle)
    return 1.5 * arch / (half_angle * half_angle * half_angle)


def _body(file: Body) -> BodyParams:
    num = [float(b) for b in file.radiation.numerator.value]
    den = [float(a) for a in file.radiation.denominator.value]
    return BodyParams(
        float(file.mass.value) + float(file.added_mass_infinite.value),
        float(file.hydrostatic.value),
        float(file.viscous_linear.value),
        float(file.viscous_quadratic.value),
        *reversed(den),
        *reversed(num),
    )


def _pto(file: Pto) -> PtoParams:
    force_per_current = float(file.torque_constant.value * file.gear_ratio.value)
    return PtoParams(
        force_per_current,
        file.winding_resistance.value / (1.5 * force_per_current * force_per_current),
        float(file.drivetrain_viscous.value),
        float(file.drivetrain_coulomb.value),
        float(file.coulomb_velocity.value),
    )


def _spring(file: Spring, stator: Stator) -> SpringParams:
    lever = float(file.lever.value)
    return SpringParams(
        1.0 / lever,
        lever / fit_slope(file.fit_half_angle.value),
        1 if file.law.value == "sine" else 0,
        float(file.spring_effect.value),
        tuple(float(station) for station in file.stator_positions.value),
        tuple(float(rate) for rate in file.spring_rates.value),
        100.0 * stator.speed.value / stator.travel.value,
    )


def _drive(file: Drive) -> DriveParams:
    return DriveParams(
        float(file.current_limit.value),
        float(file.current_time_constant.value),
        float(file.enable_delay.value),
        float(file.watchdog.value),
        float(file.fixed_loss.value),
        float(file.linear_loss.value),
        float(file.square_loss.value),
        float(file.bus_voltage.value),
        float(file.bus_resistance.value),
        float(file.analyser_window.value),
    )


def _sensors(file: Sensors, gear_ratio: float) -> SensorParams:
    force = float(file.force_resolution.value)
    pot = (file.string_pot_bias, file.string_pot_noise, file.string_pot_resolution)
    bias, noise, resolution = (float(entry.value) for entry in pot)
    current = (float(file.current_noise.value), float(file.current_resolution.value))
    return SensorParams(
        gear_ratio / (2.0 * math.pi) * file.encoder_counts.value,
        file.encoder_offset.value,
        Channel(0.0, *current, 1, 0),
        Channel(bias, noise, resolution, 3, 20011),
        Channel(float(file.lcb_bias.value), float(file.lcb_noise.value), force, 5, 40009),
        Channel(float(file.trs_bias.value), float(file.trs_noise.value), force, 7, 60013),
        Channel(0.0, float(file.rotor_noise.value), 0.0, 11, 80021),
    )
