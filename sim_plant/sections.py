"""Sections of a plant file except its drives: hull, PTO, spring, surge, sensors, basin."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from sim_plant.drive_sections import DriveControl
from sim_plant.entries import (
    Count,
    Damping,
    Entry,
    Inertia,
    NonNegative,
    Positive,
    Radiation,
    Signed,
    Stiffness,
    StrictModel,
    TableRow,
    Text,
)

Fraction = Annotated[float, Field(ge=0.0, le=1.0)]
Coordinate = Annotated[float, Field(ge=-100.0, le=100.0)]


class Body(StrictModel):
    """The floating body in heave."""

    mass: Entry[Inertia, Literal["kg"]]
    added_mass_infinite: Entry[Inertia, Literal["kg"]]
    hydrostatic: Entry[Stiffness, Literal["N/m"]]
    viscous_linear: Entry[Damping, Literal["N s/m"]]
    viscous_quadratic: Entry[Damping, Literal["N s2/m2"]]
    radiation: Radiation


class Surge(StrictModel):
    """Hull and carriage in surge with their motor drive; `bem` is next to the plant's bem."""

    bem: Text
    mass: Entry[Inertia, Literal["kg"]]
    carriage_mass: Entry[Annotated[float, Field(ge=0.0, le=1.0e6)], Literal["kg"]]
    added_mass_infinite: Entry[Inertia, Literal["kg"]]
    stiffness: Entry[Stiffness, Literal["N/m"]]
    viscous_linear: Entry[Damping, Literal["N s/m"]]
    viscous_quadratic: Entry[Damping, Literal["N s2/m2"]]
    radiation: Radiation
    drive: DriveControl

    @model_validator(mode="after")
    def _check_carriage_mass(self) -> Surge:
        if not self.carriage_mass.value < self.mass.value:
            raise ValueError("carriage_mass is a part of mass and must be smaller")
        return self


class Pto(StrictModel):
    """Motor and drivetrain."""

    torque_constant: Entry[Positive, Literal["N m/A"]]
    winding_resistance: Entry[Positive, Literal["ohm"]]
    gear_ratio: Entry[Positive, Literal["rad/m"]]
    drivetrain_viscous: Entry[Damping, Literal["N s/m"]]
    drivetrain_coulomb: Entry[NonNegative, Literal["N"]]
    guide_friction: Entry[Fraction, Literal["1"]]
    coulomb_velocity: Entry[Annotated[float, Field(ge=0.001, le=0.1)], Literal["m/s"]]


class Spring(StrictModel):
    """Magnetic spring: rate over stator position, torque law, rate factor, axial force."""

    law: Entry[Literal["sine", "linear"], Literal["1"]]
    spring_effect: Entry[Annotated[float, Field(ge=0.0, le=1.5)], Literal["1"]]
    lever: Entry[Annotated[float, Field(gt=0.0, le=10.0)], Literal["m/rad"]]
    fit_half_angle: Entry[Annotated[float, Field(gt=0.0, lt=1.5)], Literal["rad"]]
    stator_positions: Entry[TableRow, Literal["%"]]
    spring_rates: Entry[TableRow, Literal["N/m"]]
    slew_lever: Entry[Annotated[float, Field(gt=0.0, le=10.0)], Literal["m"]]
    stator_pull: Entry[Annotated[float, Field(ge=0.0, le=1000.0)], Literal["1/m"]]
    stator_share_a: Entry[Fraction, Literal["1"]]

    @model_validator(mode="after")
    def _check_table(self) -> Spring:
        positions, rates = self.stator_positions.value, self.spring_rates.value
        if len(positions) != len(rates):
            raise ValueError(f"{len(positions)} stator positions but {len(rates)} spring rates")
        if any(b <= a for a, b in pairwise(positions)):
            raise ValueError("stator positions must ascend")
        return self


class Stator(StrictModel):
    """Stator actuator."""

    speed: Entry[Positive, Literal["m/s"]]
    travel: Entry[Positive, Literal["m per 100 %"]]
    start: Entry[Annotated[float, Field(ge=-100.0, le=100.0)], Literal["%"]]


class Sensors(StrictModel):
    """Sensor scales and errors; noise is the standard deviation of one sample."""

    delay_ticks: Entry[Annotated[int, Field(ge=0, le=20)], Literal["tick"]]
    encoder_counts: Entry[Annotated[int, Field(ge=100, le=100_000_000)], Literal["count/rev"]]
    encoder_offset: Entry[Count, Literal["count"]]
    surge_encoder_offset: Entry[Count, Literal["count"]]
    current_noise: Entry[NonNegative, Literal["A"]]
    current_resolution: Entry[NonNegative, Literal["A"]]
    string_pot_bias: Entry[Signed, Literal["m"]]
    string_pot_noise: Entry[NonNegative, Literal["m"]]
    string_pot_resolution: Entry[NonNegative, Literal["m"]]
    lcb_bias: Entry[Signed, Literal["N"]]
    lcb_noise: Entry[NonNegative, Literal["N"]]
    trs_bias: Entry[Signed, Literal["N"]]
    trs_noise: Entry[NonNegative, Literal["N"]]
    slew_bias: Entry[Signed, Literal["N"]]
    slew_noise: Entry[NonNegative, Literal["N"]]
    stator_a_bias: Entry[Signed, Literal["N"]]
    stator_b_bias: Entry[Signed, Literal["N"]]
    stator_noise: Entry[NonNegative, Literal["N"]]
    force_resolution: Entry[NonNegative, Literal["N"]]
    heave_force_lag: Entry[Annotated[float, Field(ge=0.0, le=0.1)], Literal["s"]]
    rotor_noise: Entry[NonNegative, Literal["rad"]]
    probe_noise: Entry[NonNegative, Literal["m"]]
    probe_resolution: Entry[NonNegative, Literal["m"]]


class Waves(StrictModel):
    """Wave maker."""

    onset: Entry[Annotated[float, Field(ge=0.0, le=100.0)], Literal["s"]]


class ProbePosition(StrictModel):
    """Position of a probe from the device: x along the waves (positive behind it), y across."""

    x: Entry[Coordinate, Literal["m"]]
    y: Entry[Coordinate, Literal["m"]]


class Basin(StrictModel):
    """The three probes."""

    probe_1: ProbePosition
    probe_2: ProbePosition
    probe_3: ProbePosition
