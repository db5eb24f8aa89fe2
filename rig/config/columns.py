"""The columns of a gain matrix in files: those of a kind of rig, and those of its control law."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import AfterValidator, Field

from controllers import impedance
from controllers.law import Column as LawColumn
from rig.config.model import Reason, rule_error
from rig.row_contents import LAW, Column

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


def law_column_type(column: LawColumn) -> Any:
    """Return type and range of a law's column or parameter."""
    constraints: list[Any] = [Field(ge=column.low, le=column.high)]
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
    def _leading(self) -> tuple[Column, ...]:
        return () if self.first is None else (self.first,)

    @property
    def actuator(self) -> Column | None:
        """The position of the device that moves between rows for the first column."""
        return None if self.first is None else self.first.actuator

    def with_law(self, law_columns: Iterable[LawColumn]) -> tuple[Column, ...]:
        """Return the columns of a matrix: the first, those of the law, the others."""
        from_law = (
            Column(
                each.key,
                each.name,
                each.unit,
                each.label,
                **{"role": LAW} | self.law_details.get(each.key, {}),
            )
            for each in law_columns
        )
        return (*self._leading, *from_law, *self.others)

    def required(self, law_columns: Iterable[LawColumn]) -> tuple[Column, ...]:
        """Return the columns of every matrix: the first, and the law's without a default."""
        law_columns = tuple(law_columns)
        needed = {each.key for each in law_columns if each.default is None}
        needed |= {each.key for each in self._leading}
        return tuple(each for each in self.with_law(law_columns) if each.key in needed)

    def problems(self, law_columns: Iterable[LawColumn]) -> tuple[str, ...]:
        """Return the clashes of a law's columns with the other columns of a matrix."""
        own = (*self._leading, *self.others)
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
