"""The results of a bench session: constants with unit and uncertainty, and tables.

The file records its run and date; rigs and sessions name it under `calibrations`.
"""

from collections.abc import Iterator
from typing import Any

from pydantic import Field, field_validator

from rig.config.model import FileModel, RuleViolation, TupleOf, WholeNumber, rule_error
from rig.config.problems import format_number, format_value
from rig.config.unit_factors import factor_note

CONSTANT_UNITS = {
    "torque_constant": "N*m/A",
    "torque_constant_positive": "N*m/A",  # for currents above zero
    "torque_constant_negative": "N*m/A",
    "velocity_constant": "rad/s/V",
    "velocity_constant_loaded": "rad/s/V",  # from driveline runs
    "velocity_loop_lag": "s",  # delay of the motor relative to the commanded velocity
}
"""Units of the constants that a plan reads; a file may hold other constants."""


class Constant(FileModel):
    """A measured constant with unit, uncertainty and method."""

    value: float = Field(ge=-1e9, le=1e9)
    unit: str = Field(min_length=1, max_length=32)
    uncertainty: float = Field(ge=0, le=1e9)  # half width of the 95 % confidence interval
    method: str = Field(default="", max_length=300)  # of the value and of its interval


class Branch(FileModel):
    """One branch of the brake's map."""

    current_a: TupleOf[float] = Field(min_length=2, strict=False)
    torque_n_m: TupleOf[float] = Field(min_length=2, strict=False)
    uncertainty_n_m: TupleOf[float] = Field(default=(), strict=False)  # half widths, 95 %

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the lists have the same length and that currents and torques rise."""
        lists = ("current_a", "torque_n_m", "uncertainty_n_m")
        yield from _check_lists(self, lists, rising=lists[:2])


class BrakeMap(FileModel):
    """Torque of the brake over its current, with a branch for rising and for falling current."""

    rising: Branch
    falling: Branch


class DeflectionMap(FileModel):
    """Deflection (motor minus shaft) over the torque of the driveline."""

    torque_n_m: TupleOf[float] = Field(min_length=2, strict=False)
    deflection_deg: TupleOf[float] = Field(min_length=2, strict=False)

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that the lists have the same length and that torques rise."""
        lists = ("torque_n_m", "deflection_deg")
        yield from _check_lists(self, lists, rising=lists[:1])


class DrivelinePoint(FileModel):
    """The results of one uncorrected row of a driveline run."""

    row: WholeNumber = Field(ge=0, le=10_000)
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
    driveline: TupleOf[DrivelinePoint] = Field(default=(), strict=False)

    @field_validator("constants", mode="before")
    @classmethod
    def _require_mapping(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            raise rule_error(f"{format_value(value)} is not a mapping of names to constants")
        return value

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check unit and sign of the constants that a plan reads, and that the file has results."""
        for name, unit in CONSTANT_UNITS.items():
            constant = self.constants.get(name)
            if constant is None:
                continue
            if constant.unit != unit:
                key = ("constants", name, "unit")
                message = f"{constant.unit!r} is not the unit of {name}; allowed {unit}"
                if note := factor_note(constant.unit, [unit]):
                    message += f": {note}"
                yield RuleViolation(key, message, constant.unit)
            if constant.value <= 0.0:
                key = ("constants", name, "value")
                message = f"{format_number(constant.value)} is out of range; allowed above 0 {unit}"
                yield RuleViolation(key, message, constant.value)
        if not (self.constants or self.brake_map or self.deflection_map or self.driveline):
            message = "no result; allowed constants, brake_map, deflection_map, driveline"
            yield RuleViolation((), message)


def _check_lists(
    model: FileModel, keys: tuple[str, ...], rising: tuple[str, ...]
) -> Iterator[RuleViolation]:
    """Check that given lists are as long as the first one, and that those ``rising`` rise."""
    lists: list[tuple[float, ...]] = [getattr(model, key) for key in keys]
    for key, values in zip(keys, lists, strict=True):
        if values and len(values) != len(lists[0]):
            message = f"{len(values)} entries; allowed {len(lists[0])}, as in {keys[0]}"
            yield RuleViolation((key,), message)
    for key in rising:
        yield from model.check_rising(getattr(model, key), (key,))
