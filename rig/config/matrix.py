"""The gain matrix of a campaign file: a grid, a list, or a CSV beside it."""

import math
from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from rig.config.model import Broken, FileModel, Reason, Several, refuse
from rig.config.problems import number_text, value_text

END_MARK = -999.0
"""Kp that ends an imported matrix. It is never a gain."""

MOST_VALUES = 1000
"""Most values one range may give; more is a slip in `step`."""


def _not_the_end_mark(kp: float) -> float:
    if kp == END_MARK:
        raise refuse("-999 ends an imported matrix and is never a gain; leave the row out")
    return kp


def _expanded(value: Any) -> Any:
    """A number, a list or {from, to, step} as a list; what is none of them stays for pydantic."""
    if isinstance(value, dict):
        return _range(value)
    if isinstance(value, (list, tuple)):
        if not value:
            raise refuse("the list is empty; allowed at least 1 entry")
        return value
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


Kp = Annotated[
    float,
    Field(ge=-20_000, le=0),
    Reason("F = Kp v on the body: Kp > 0 would drive it, Kp < 0 absorbs"),
    AfterValidator(_not_the_end_mark),
]
"""Velocity gain, N*s/m."""

Ki = Annotated[float, Field(ge=-30_000, le=30_000)]
"""Position gain, N/m; Ki > 0 acts as a negative spring."""

SpringRate = Annotated[float, Field(ge=-50_000, le=50_000)]
"""Small-displacement spring rate, N/m; the rig's map says which it has."""

Values = BeforeValidator(_expanded)


class Grid(FileModel):
    """All combinations at one spring rate, or at several; Kp outer, Ki inner."""

    spring_n_per_m: Annotated[Several[SpringRate], Values]
    kp_n_s_per_m: Annotated[Several[Kp], Values]
    ki_n_per_m: Annotated[Several[Ki], Values]


class Combination(FileModel):
    """One combination of the gain matrix."""

    spring_n_per_m: SpringRate
    kp_n_s_per_m: Kp
    ki_n_per_m: Ki


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
        # By the keys, before their values: one left empty would pass for one that is not there.
        given = [key for key in FORMS if key in value] if isinstance(value, dict) else []
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
