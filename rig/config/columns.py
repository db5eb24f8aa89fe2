"""The columns of a gain matrix: key in a file, name of the set point, unit, range."""

from typing import Annotated, Literal, NamedTuple

from pydantic import AfterValidator, Field

from rig.config.model import Reason, WholeNumber, rule_error

END_MARK = -999.0
"""Value of Kp that marks the end of an imported matrix; it is never a gain."""


def _reject_end_mark(kp: float) -> float:
    if kp == END_MARK:
        raise rule_error("-999 ends an imported matrix and is never a gain; leave the row out")
    return kp


Kp = Annotated[
    float,
    Field(ge=-20_000, le=0),
    Reason("F = Kp v on the body: Kp > 0 would drive it, Kp < 0 absorbs"),
    AfterValidator(_reject_end_mark),
]
"""Velocity gain, N*s/m."""

Ki = Annotated[float, Field(ge=-30_000, le=30_000)]
"""Position gain, N/m; Ki > 0 acts as a negative spring."""

Km = Annotated[float, Field(ge=-500, le=500)]
"""Acceleration gain, kg; Km > 0 acts as a negative mass."""

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


COLUMNS = (
    Column("spring_n_per_m", "spring_rate", "N/m", "spring rate"),
    Column("kp_n_s_per_m", "kp", "N*s/m", "Kp"),
    Column("ki_n_per_m", "ki", "N/m", "Ki"),
    Column("km_kg", "km", "kg", "Km"),
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
"""Every matrix has spring rate, Kp and Ki; the other columns are optional."""

REQUIRED_COLUMNS = COLUMNS[:3]
DRIVE_COLUMNS = COLUMNS[8:]
