"""The columns of a gain matrix: key in a file, name of the set point, unit, range."""

from collections.abc import Iterable
from functools import cache
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import AfterValidator, Field

from controllers import impedance
from controllers.law import Column as LawColumn
from rig.config.model import Reason, WholeNumber, rule_error

_KP, _KI, _KM = impedance.COLUMNS

END_MARK = -999.0
"""Value of Kp that marks the end of an imported matrix; it is never a gain."""


def _reject_end_mark(kp: float) -> float:
    if kp == END_MARK:
        raise rule_error("-999 ends an imported matrix and is never a gain; leave the row out")
    return kp


Kp = Annotated[
    float,
    Field(ge=_KP.low, le=_KP.high),
    Reason(_KP.reason),
    AfterValidator(_reject_end_mark),
]
"""Velocity gain of the impedance law, N*s/m."""

Ki = Annotated[float, Field(ge=_KI.low, le=_KI.high)]
"""Position gain of the impedance law, N/m; Ki > 0 acts as a negative spring."""

SpringRate = Annotated[float, Field(ge=-50_000, le=50_000)]
"""Small-displacement spring rate, N/m; the rig's spring map gives the available range."""

ReferenceScale = Annotated[float, Field(ge=-10, le=10)]
"""Factor on the campaign's open-loop reference."""

Realisation = Annotated[WholeNumber, Field(ge=1, le=100)]
"""Number of the realisation of the campaign's multisine reference; each has other phases."""

SurgeKp = Annotated[
    float,
    Field(ge=-20_000, le=0),
    Reason("surge is held like a mooring: it may only take energy"),
]
"""Velocity gain of surge, N*s/m."""

SurgeKi = Annotated[
    float,
    Field(ge=-30_000, le=0),
    Reason("surge is held like a mooring: Ki > 0 would push it away"),
]
"""Position gain of surge, N/m."""

ModulationScheme = Literal["svpwm", "sine-triangle", "dpwm", "hysteresis"]
"""Modulation of the bridge; set in the firmware, so per run and not a column of the matrix."""

BusVoltage = Annotated[float, Field(ge=20, le=150)]
"""Set point of the DC bus, V."""

SwitchingPeriod = Annotated[float, Field(ge=2e-5, le=1e-3)]
"""Switching period, s: 1 .. 50 kHz."""

HysteresisTolerance = Annotated[float, Field(ge=0.1, le=10)]
"""Dead band of the current in the hysteresis scheme, A."""

VelocityThreshold = Annotated[float, Field(ge=0, le=1)]
"""Speed below which the power stage does not switch, m/s; 0: it always switches."""

CurrentThreshold = Annotated[float, Field(ge=0, le=40)]
"""Commanded current below which the power stage may stop switching, A; 0: at any current."""

DischargeLevel = Annotated[WholeNumber, Field(ge=0, le=15)]
"""Set of the four dump resistors in use: 1 one, 15 all."""


class Column(NamedTuple):
    """One quantity that may change from row to row."""

    key: str  # in files
    name: str  # of the set point, and in the row table
    unit: str
    label: str  # on axes


SPRING_COLUMN = Column("spring_n_per_m", "spring_rate", "N/m", "spring rate")
OTHER_COLUMNS = (
    Column("reference_scale", "reference_scale", "1", "reference scale"),
    Column("realisation", "realisation", "1", "realisation"),
    Column("surge_kp_n_s_per_m", "surge_kp", "N*s/m", "surge Kp"),
    Column("surge_ki_n_per_m", "surge_ki", "N/m", "surge Ki"),
    Column("bus_voltage_v", "bus_voltage", "V", "bus voltage"),
    Column("switching_period_s", "switching_period", "s", "switching period"),
    Column("hysteresis_a", "hysteresis_tolerance", "A", "hysteresis"),
    Column("velocity_threshold_m_per_s", "velocity_threshold", "m/s", "velocity threshold"),
    Column("discharge_level", "discharge_level", "1", "discharge level"),
)
"""The columns that a matrix may have in addition to the spring rate and those of its law."""

OTHER_TYPES: dict[str, Any] = {
    "reference_scale": ReferenceScale,
    "realisation": Realisation,
    "surge_kp_n_s_per_m": SurgeKp,
    "surge_ki_n_per_m": SurgeKi,
    "bus_voltage_v": BusVoltage,
    "switching_period_s": SwitchingPeriod,
    "hysteresis_a": HysteresisTolerance,
    "velocity_threshold_m_per_s": VelocityThreshold,
    "discharge_level": DischargeLevel,
}
"""Type and range of each of the other columns, by key."""


@cache
def columns_with_law(law_columns: tuple[LawColumn, ...]) -> tuple[Column, ...]:
    """Return the columns of a matrix: spring rate, those of the law, the others."""
    from_law = (Column(each.key, each.name, each.unit, each.label) for each in law_columns)
    return (SPRING_COLUMN, *from_law, *OTHER_COLUMNS)


def required_columns(law_columns: tuple[LawColumn, ...]) -> tuple[Column, ...]:
    """Return the columns of every matrix: spring rate, and the law's columns without a default."""
    needed = {each.key for each in law_columns if each.default is None}
    return tuple(
        each
        for each in columns_with_law(law_columns)
        if each.key in needed or each is SPRING_COLUMN
    )


def law_column_type(column: LawColumn) -> Any:
    """Return type and range of a law's column or parameter."""
    constraints: list[Any] = [Field(ge=column.low, le=column.high)]
    if column.reason:
        constraints.append(Reason(column.reason))
    if column.key == _KP.key:
        constraints.append(AfterValidator(_reject_end_mark))
    return Annotated[(float, *constraints)]


def column_problems(law_columns: Iterable[LawColumn]) -> tuple[str, ...]:
    """Return the clashes of a law's columns with the other columns of a matrix."""
    others = (SPRING_COLUMN, *OTHER_COLUMNS)
    taken = {each.key for each in others} | {each.name for each in others} | _ROW_TABLE_NAMES
    return tuple(
        f"its column {each.key} ({each.name}) has the name of another column or of a row's result"
        for each in law_columns
        if each.key in taken or each.name in taken
    )


_ROW_TABLE_NAMES = {"row", "point", "repetition", "stator", "periods", "measure_s", "state"}

COLUMNS = columns_with_law(impedance.COLUMNS)
"""The columns of a matrix for the impedance law, and of runs that do not list theirs."""

REQUIRED_COLUMNS = required_columns(impedance.COLUMNS)
DRIVE_COLUMNS = OTHER_COLUMNS[4:]
