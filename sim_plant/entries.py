"""Entries of a plant file: a value in an allowed range, its unit and its source."""

from __future__ import annotations

from typing import Annotated, Generic, Literal, TypeVar

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

Value = TypeVar("Value")
Unit = TypeVar("Unit")
Text = Annotated[str, StringConstraints(strip_whitespace=True, min_length=1)]


class StrictModel(BaseModel):
    """Base model: frozen, strict, without unknown keys or infinities; ints are valid floats."""

    model_config = ConfigDict(
        frozen=True, extra="forbid", strict=True, allow_inf_nan=False, defer_build=True
    )


class Entry(StrictModel, Generic[Value, Unit]):
    """One number of the plant file: value (in the field's range), unit, and source of the value."""

    value: Value
    unit: Unit
    source: Text


TableRow = Annotated[tuple[float, ...], Field(min_length=2, max_length=32, strict=False)]

Inertia = Annotated[float, Field(gt=0.0, le=1.0e6)]
Stiffness = Annotated[float, Field(gt=0.0, le=1.0e7)]
Damping = Annotated[float, Field(ge=0.0, le=1.0e5)]
NonNegative = Annotated[float, Field(ge=0.0, le=1.0e4)]
Positive = Annotated[float, Field(gt=0.0, le=1.0e4)]
Time = Annotated[float, Field(gt=0.0, le=100.0)]
Signed = Annotated[float, Field(ge=-1.0e4, le=1.0e4)]
Count = Annotated[int, Field(ge=-(10**9), le=10**9)]


class Radiation(StrictModel):
    """Rational fit of the radiation memory, highest power first, leading denominator 1 omitted."""

    numerator: Entry[TableRow, Literal["SI, s4 to s1"]]
    denominator: Entry[TableRow, Literal["SI, s4 to s0"]]

    @model_validator(mode="after")
    def _check_passivity(self) -> Radiation:
        """Reject a fit of another order or one that violates the high-frequency passivity bound."""
        num, den = self.numerator.value, self.denominator.value
        if len(num) != 4 or len(den) != 5:
            raise ValueError("the radiation fit has 4 numerator and 5 denominator coefficients")
        if den[0] * num[0] < num[1]:
            raise ValueError("the radiation fit is not passive: a(n-1) b(n-1) < b(n-2)")
        return self
