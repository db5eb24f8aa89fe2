"""The gain matrix of a campaign file: its columns, and a grid, a list or the name of a CSV file."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, partial
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    SerializerFunctionWrapHandler,
    create_model,
    model_serializer,
    model_validator,
)

from controllers import impedance
from controllers.law import Column as LawColumn
from rig.config.model import FileModel, Reason, RuleViolation, TupleOf, rule_error
from rig.config.problems import format_number, format_value
from rig.row_contents import CATEGORICAL, LAW, Column

END_MARK = -999.0
"""Value of Kp that marks the end of an imported matrix; it is never a gain."""

_KP = impedance.COLUMNS[0]

LawColumns = tuple[LawColumn, ...]
"""The columns of one law or, of a rig with several axes, of all their laws."""


def reject_end_mark(kp: float) -> float:
    """Return a gain; a rule error for `END_MARK`."""
    if kp == END_MARK:
        raise rule_error("-999 ends an imported matrix and is never a gain; leave the row out")
    return kp


def number_of_choice(choices: tuple[str, ...], value: Any) -> Any:
    """Return the number of a name, or a number as it is; a rule error for anything else."""
    if isinstance(value, str) and value in choices:
        return float(choices.index(value))
    number = float(value) if isinstance(value, int | float) else -1.0
    if isinstance(value, bool) or number not in range(len(choices)):
        allowed = f"allowed {', '.join(choices)}, or 0 .. {len(choices) - 1} in this order"
        raise rule_error(f"{format_value(value)} is none of the names; {allowed}")
    return number


def law_column_type(column: LawColumn) -> Any:
    """Return type and range of a law's column or parameter."""
    constraints: list[Any] = [Field(ge=column.low, le=column.high)]
    if column.choices:
        constraints.append(BeforeValidator(partial(number_of_choice, column.choices)))
    if column.reason:
        constraints.append(Reason(column.reason))
    if column.key == _KP.key:
        constraints.append(AfterValidator(reject_end_mark))
    return Annotated[(float, *constraints)]


@dataclass(frozen=True, eq=False)
class KindColumns:
    """The columns that a kind of rig gives every gain matrix, and its details of laws' columns."""

    first: Column | None  # every matrix has it, if any; the laws' columns follow
    others: tuple[Column, ...]  # a matrix may have them
    types: Mapping[str, Any]  # type and range of these columns by key
    law_details: Mapping[str, dict[str, Any]]  # further fields of a law's columns by key

    @property
    def actuator(self) -> Column | None:
        """The position of the device that moves between rows for the first column."""
        return None if self.first is None else self.first.actuator

    def with_law(self, law_columns: Iterable[LawColumn]) -> tuple[Column, ...]:
        """Return the columns of a matrix: the first, those of the law, the others."""
        return (*self.first_and(law_columns), *self.others)

    def first_and(self, law_columns: Iterable[LawColumn]) -> tuple[Column, ...]:
        """Return the first column, if there is one, and columns of the law."""
        from_law = (
            Column(
                each.key,
                each.name,
                each.unit,
                each.label,
                choices=each.choices,
                laws=each.laws,
                **{"role": CATEGORICAL if each.choices else LAW}
                | self.law_details.get(each.key, {}),
            )
            for each in law_columns
        )
        return (*(() if self.first is None else (self.first,)), *from_law)

    def required(self, law_columns: Iterable[LawColumn]) -> tuple[Column, ...]:
        """Return the columns of every matrix: the first, and the law's without a default."""
        return self.first_and(each for each in law_columns if each.default is None)

    def problems(self, law_columns: Iterable[LawColumn]) -> tuple[str, ...]:
        """Return the clashes of a law's columns with the other columns of a matrix."""
        own = self.with_law(())
        taken = {each.key for each in own} | {each.name for each in own} | _ROW_TABLE_NAMES
        if self.actuator is not None:
            taken.add(self.actuator.name)
        return tuple(
            f"its column {each.key} ({each.name}) has the name of another column or of a row's "
            "result"
            for each in law_columns
            if each.key in taken or each.name in taken
        )


_ROW_TABLE_NAMES = {"row", "point", "repetition", "periods", "measure_s", "state"}


MAX_RANGE_VALUES = 1000
"""Maximum number of values of a range; a larger number is taken for an error in `step`."""


def expand_values(value: Any) -> Any:
    """Return a number, a list or {from, to, step} as a tuple of values.

    None (a column that is not given) stays None. Values of a wrong type are left to pydantic.
    """
    if value is None:
        return value
    if isinstance(value, dict):
        return _expand_range(value)
    if isinstance(value, (list, tuple)):
        if not value:
            raise rule_error("the list is empty; allowed at least 1 entry")
        return tuple(value)
    return (value,)


def _expand_range(value: dict[str, Any]) -> tuple[float, ...]:
    names = ("from", "to", "step")
    for key in value:
        if key not in names:
            raise rule_error("unknown key; a range has from, to, step", key)
    numbers = []
    for key in names:
        if key not in value:
            raise rule_error("missing; a range has from, to, step", key)
        number = value[key]
        if isinstance(number, bool) or not isinstance(number, (int, float)):
            raise rule_error(f"{format_value(number)} is not a number", key)
        if not math.isfinite(number):
            raise rule_error(f"{format_value(number)} is not a finite number", key)
        numbers.append(float(number))
    first, last, step = numbers
    if first == last:
        return (first,)
    if step == 0.0 or (last > first) != (step > 0.0):
        sign = "above 0" if last > first else "below 0"
        raise rule_error(
            f"{format_number(step)} does not lead from `from` to `to`; allowed {sign}", "step"
        )
    steps = (last - first) / step
    if steps > MAX_RANGE_VALUES - 1:
        raise rule_error(f"{format_number(step)} gives over {MAX_RANGE_VALUES} values", "step")
    whole = round(steps)
    if whole == 0 or abs(steps - whole) > 1e-6:
        end = first + math.floor(steps) * step
        raise rule_error(
            f"{format_number(last)} is not reached: the last step ends on {end:.10g}", "to"
        )
    # Each value is computed from the first, not from its neighbour, so rounding errors do not add.
    values = (first + (last - first) * i / whole for i in range(whole + 1))
    return tuple(float(f"{v:.12g}") for v in values)


ExpandValues = BeforeValidator(expand_values)


class GivenKeys(FileModel):
    """A mapping that is written with the given keys alone, so that it can be read again."""

    @model_serializer(mode="wrap")
    def _drop_missing(self, dump: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return {key: value for key, value in dump(self).items() if value is not None}


class MatrixColumns(GivenKeys):
    """Values that may change from row to row; a missing column takes the campaign's value."""


@cache
def combination_model(
    kind_columns: KindColumns, law_columns: tuple[LawColumn, ...], *, grid: bool = False
) -> type[MatrixColumns]:
    """Return the model of one combination of the gain matrix, for a kind's and a law's columns.

    With ``grid`` that of all combinations of given values; the last given column changes fastest.
    """

    def field(kind: Any, required: bool, label: str) -> Any:
        values = tuple_of(kind) if grid else kind
        values = values if required else values | None
        default = Field(... if required else None, description=label)
        return (Annotated[values, ExpandValues] if grid else values, default)

    types, first = kind_columns.types, kind_columns.first
    fields = {} if first is None else {first.key: field(types[first.key], True, first.label)}
    for column in law_columns:
        required, text = column.default is None, column.help or column.label
        fields[column.key] = field(law_column_type(column), required, text)
    fields |= {each.key: field(types[each.key], False, each.label) for each in kind_columns.others}
    return create_model("Grid" if grid else "Combination", __base__=MatrixColumns, **fields)


MATRIX_FORMS = ("grid", "list", "csv")
_ALLOWED_FORMS = "allowed exactly one of " + ", ".join(MATRIX_FORMS)


class Matrix(GivenKeys):
    """The gain matrix, given in exactly one of three forms; `matrix_model` adds the columns."""

    grid: TupleOf[MatrixColumns] | None = Field(default=None, min_length=1, strict=False)
    """Products of the values of the columns."""
    combinations: TupleOf[MatrixColumns] | None = Field(
        default=None, min_length=1, alias="list", strict=False
    )
    """One mapping of columns for each row."""
    csv: str | None = Field(default=None, min_length=1)  # file, relative to this one

    @model_validator(mode="before")
    @classmethod
    def _one_form(cls, value: Any) -> Any:
        # This check precedes that of the values, so that an empty list counts as given. A key
        # without a value removes the key of an extended file, so it does not count.
        mapping = value if isinstance(value, dict) else {}
        given = [key for key in MATRIX_FORMS if mapping.get(key) is not None]
        if len(given) > 1:
            forms = " and ".join(key if value[key] else f"{key} (empty)" for key in given)
            raise rule_error(f"{forms} given; {_ALLOWED_FORMS}")
        return value

    def check_rules(self) -> Iterator[RuleViolation]:
        """Check that a form is given; `_one_form` has already refused more than one."""
        if self.grid is None and self.combinations is None and self.csv is None:
            yield RuleViolation((), f"nothing given; {_ALLOWED_FORMS}")


def tuple_of(kind: Any) -> Any:
    """Return `TupleOf` of a type that is made at run time."""
    return Annotated[tuple[kind, ...], Field(strict=False)]


@cache
def matrix_model(kind_columns: KindColumns, law_columns: tuple[LawColumn, ...]) -> type[Matrix]:
    """Return the model of the gain matrix with a kind's and a law's columns."""
    grid = tuple_of(combination_model(kind_columns, law_columns, grid=True))
    combination = tuple_of(combination_model(kind_columns, law_columns))
    fields: dict[str, Any] = {
        "grid": (grid | None, Field(default=None, min_length=1, strict=False)),
        "combinations": (
            combination | None,
            Field(default=None, min_length=1, alias="list", strict=False),
        ),
    }
    return create_model("Matrix", __base__=Matrix, **fields)
