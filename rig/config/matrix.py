"""The gain matrix of a campaign file: a grid, a list, or a CSV beside it."""

import math
from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import (
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from rig.config.columns import (
    BusVoltage,
    DischargeLevel,
    HysteresisTolerance,
    Ki,
    Km,
    Kp,
    Realisation,
    ReferenceScale,
    SpringRate,
    SurgeKi,
    SurgeKp,
    SwitchingPeriod,
    VelocityThreshold,
)
from rig.config.model import Broken, FileModel, Several, refuse
from rig.config.problems import number_text, value_text

MOST_VALUES = 1000
"""Most values one range may give; more is a slip in `step`."""


def expanded(value: Any) -> Any:
    """A number, a list or {from, to, step} as a list; what is none of them stays for pydantic."""
    if value is None:  # a column that is not there
        return value
    if isinstance(value, dict):
        return _range(value)
    if isinstance(value, (list, tuple)):
        if not value:
            raise refuse("the list is empty; allowed at least 1 entry")
        return tuple(value)
    return (value,)


def _range(value: dict[str, Any]) -> tuple[float, ...]:
    names = ("from", "to", "step")
    for key in value:
        if key not in names:
            raise refuse("unknown key; a range has from, to, step", key)
    numbers = []
    for key in names:
        if key not in value:
            raise refuse("missing; a range has from, to, step", key)
        number = value[key]
        if isinstance(number, bool) or not isinstance(number, (int, float)):
            raise refuse(f"{value_text(number)} is not a number", key)
        if not math.isfinite(number):
            raise refuse(f"{value_text(number)} is not a finite number", key)
        numbers.append(float(number))
    first, last, step = numbers
    if first == last:
        return (first,)
    if step == 0.0 or (last > first) != (step > 0.0):
        sign = "above 0" if last > first else "below 0"
        raise refuse(
            f"{number_text(step)} does not lead from `from` to `to`; allowed {sign}", "step"
        )
    steps = (last - first) / step
    if steps > MOST_VALUES - 1:
        raise refuse(f"{number_text(step)} gives over {MOST_VALUES} values", "step")
    whole = round(steps)
    if whole == 0 or abs(steps - whole) > 1e-6:
        end = first + math.floor(steps) * step
        raise refuse(f"{number_text(last)} is not reached: the last step ends on {end:.10g}", "to")
    # Each value from the start, not from its neighbour: rounding does not add up.
    values = (first + (last - first) * i / whole for i in range(whole + 1))
    return tuple(float(f"{v:.12g}") for v in values)


Values = BeforeValidator(expanded)


class _Columns(FileModel):
    """What may change from row to row; a column that is not given takes the campaign's value."""

    @model_serializer(mode="wrap")
    def _given(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {key: value for key, value in dump(self).items() if value is not None}


class Grid(_Columns):
    """All combinations of the values given; spring rate outermost, then Kp, Ki and the others."""

    spring_n_per_m: Annotated[Several[SpringRate], Values]
    kp_n_s_per_m: Annotated[Several[Kp], Values]
    ki_n_per_m: Annotated[Several[Ki], Values]
    km_kg: Annotated[Several[Km] | None, Values] = None
    reference_scale: Annotated[Several[ReferenceScale] | None, Values] = None
    realisation: Annotated[Several[Realisation] | None, Values] = None
    surge_kp_n_s_per_m: Annotated[Several[SurgeKp] | None, Values] = None
    surge_ki_n_per_m: Annotated[Several[SurgeKi] | None, Values] = None
    bus_voltage_v: Annotated[Several[BusVoltage] | None, Values] = None
    switching_period_s: Annotated[Several[SwitchingPeriod] | None, Values] = None
    hysteresis_a: Annotated[Several[HysteresisTolerance] | None, Values] = None
    velocity_threshold_m_per_s: Annotated[Several[VelocityThreshold] | None, Values] = None
    discharge_level: Annotated[Several[DischargeLevel] | None, Values] = None


class Combination(_Columns):
    """One combination of the gain matrix."""

    spring_n_per_m: SpringRate
    kp_n_s_per_m: Kp
    ki_n_per_m: Ki
    km_kg: Km | None = None
    reference_scale: ReferenceScale | None = None
    realisation: Realisation | None = None
    surge_kp_n_s_per_m: SurgeKp | None = None
    surge_ki_n_per_m: SurgeKi | None = None
    bus_voltage_v: BusVoltage | None = None
    switching_period_s: SwitchingPeriod | None = None
    hysteresis_a: HysteresisTolerance | None = None
    velocity_threshold_m_per_s: VelocityThreshold | None = None
    discharge_level: DischargeLevel | None = None


FORMS = ("grid", "list", "csv")
_ONE = "allowed exactly one of " + ", ".join(FORMS)


class Matrix(FileModel):
    """The gain matrix, said in exactly one of three ways."""

    grid: Several[Grid] | None = Field(default=None, min_length=1, strict=False)
    combinations: Several[Combination] | None = Field(
        default=None, min_length=1, alias="list", strict=False
    )
    csv: str | None = Field(default=None, min_length=1)  # file, relative to this one

    @model_validator(mode="before")
    @classmethod
    def _one_form(cls, value: Any) -> Any:
        # Before their values: an empty list would pass for one that is not there. A key without
        # a value takes out what another file gives, so it is none.
        there = value if isinstance(value, dict) else {}
        given = [key for key in FORMS if there.get(key) is not None]
        if len(given) > 1:
            found = " and ".join(key if value[key] else f"{key} (empty)" for key in given)
            raise refuse(f"{found} given; {_ONE}")
        return value

    def broken_rules(self) -> Iterator[Broken]:
        """One of grid, list, csv; that no two are given is known by then."""
        if self.grid is None and self.combinations is None and self.csv is None:
            yield Broken((), f"nothing given; {_ONE}")

    @model_serializer(mode="wrap")
    def _given(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        # Only the form that is given, so that what is written can be read again.
        return {key: value for key, value in dump(self).items() if value is not None}
