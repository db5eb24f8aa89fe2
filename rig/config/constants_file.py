"""What a session of the bench found: constants with unit and uncertainty, and its tables.

Such a file says which run it is from and when; rigs and sessions name it under `calibrations`.
"""

from collections.abc import Iterator
from typing import Any

from pydantic import Field, field_validator

from rig.config.model import Broken, FileModel, Several, Whole, refuse
from rig.config.problems import number_text, value_text

UNITS = {
    "torque_constant": "N*m/A",
    "torque_constant_positive": "N*m/A",  # currents above zero
    "torque_constant_negative": "N*m/A",
    "velocity_constant": "rad/s/V",
    "velocity_constant_loaded": "rad/s/V",  # of driveline runs
    "velocity_loop_lag": "s",  # of the motor behind the commanded velocity
}
"""Constants that a plan reads, each with its one unit; a file may hold others."""


class Constant(FileModel):
    """A number with what is known of it."""

    value: float = Field(ge=-1e9, le=1e9)
    unit: str = Field(min_length=1, max_length=32)
    uncertainty: float = Field(ge=0, le=1e9)  # half width of the interval that holds it, 95 %
    method: str = Field(default="", max_length=300)  # how it was found, what the interval rests on


class Branch(FileModel):
    """One branch of the brake's map."""

    current_a: Several[float] = Field(min_length=2, strict=False)
    torque_n_m: Several[float] = Field(min_length=2, strict=False)
    uncertainty_n_m: Several[float] = Field(default=(), strict=False)  # half widths, 95 %

    def broken_rules(self) -> Iterator[Broken]:
        """Equally long; currents and torques rise."""
        yield from _paired(self.current_a, self.torque_n_m, "current_a", "torque_n_m")
        if self.uncertainty_n_m:
            yield from _as_long(
                self.current_a, self.uncertainty_n_m, "current_a", "uncertainty_n_m"
            )
        yield from _rising(self.torque_n_m, "torque_n_m")


class BrakeMap(FileModel):
    """Torque the brake holds over its current, one branch for each way the current goes."""

    rising: Branch
    falling: Branch


class DeflectionMap(FileModel):
    """Deflection (motor less shaft) over the torque of the driveline."""

    torque_n_m: Several[float] = Field(min_length=2, strict=False)
    deflection_deg: Several[float] = Field(min_length=2, strict=False)

    def broken_rules(self) -> Iterator[Broken]:
        """Equally long; torques rise."""
        yield from _paired(self.torque_n_m, self.deflection_deg, "torque_n_m", "deflection_deg")


class DrivelinePoint(FileModel):
    """What one uncorrected row of a driveline run gave."""

    row: Whole = Field(ge=0, le=10_000)
    amplitude_deg: float = Field(gt=0, le=180)
    period_s: float = Field(gt=0, le=3600)
    damping_n_m_s_per_rad: float = Field(ge=0, le=1e4)
    rms_velocity_rad_per_s: float = Field(gt=0, le=100)
    rms_torque_n_m: float = Field(ge=0, le=1e4)
    amplitude_difference_deg: float = Field(ge=-10, le=10)
    phase_shift_percent: float = Field(ge=-50, le=50)


class ConstantsFile(FileModel):
    """The results of one session."""

    name: str = Field(min_length=1, max_length=64)
    rig: str = Field(min_length=1, max_length=64)
    run: str = Field(min_length=1, max_length=200)
    date: str = Field(pattern=r"^\d{4}-\d{2}-\d{2}$")
    constants: dict[str, Constant] = Field(default_factory=dict)
    brake_map: BrakeMap | None = None
    deflection_map: DeflectionMap | None = None
    driveline: Several[DrivelinePoint] = Field(default=(), strict=False)

    @field_validator("constants", mode="before")
    @classmethod
    def _a_mapping(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            raise refuse(f"{value_text(value)} is not a mapping of names to constants")
        return value

    def broken_rules(self) -> Iterator[Broken]:
        """A constant that is read has its unit and is above zero; something is in the file."""
        for name, unit in UNITS.items():
            found = self.constants.get(name)
            if found is None:
                continue
            if found.unit != unit:
                key = ("constants", name, "unit")
                yield Broken(key, f"{found.unit!r} is not its unit; allowed {unit}", found.unit)
            if found.value <= 0.0:
                key = ("constants", name, "value")
                told = f"{number_text(found.value)} is out of range; allowed above 0 {unit}"
                yield Broken(key, told, found.value)
        if not (self.constants or self.brake_map or self.deflection_map or self.driveline):
            message = "no result; allowed constants, brake_map, deflection_map, driveline"
            yield Broken((), message)


def _paired(
    first: tuple[float, ...], second: tuple[float, ...], rising: str, other: str
) -> Iterator[Broken]:
    yield from _as_long(first, second, rising, other)
    yield from _rising(first, rising)


def _as_long(
    first: tuple[float, ...], second: tuple[float, ...], key: str, other: str
) -> Iterator[Broken]:
    if len(first) != len(second):
        message = f"{len(second)} entries; allowed {len(first)}, as in {key}"
        yield Broken((other,), message)


def _rising(values: tuple[float, ...], key: str) -> Iterator[Broken]:
    for i in range(1, len(values)):
        before, here = values[i - 1], values[i]
        if here <= before:
            message = f"{number_text(here)} does not rise above {number_text(before)}"
            yield Broken((key, i), message, here)
