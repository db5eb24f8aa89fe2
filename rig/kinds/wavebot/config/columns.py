"""The columns of a WaveBot's gain matrix: key in a file, set point, unit, range, log field."""

from typing import Annotated, Literal

from pydantic import AfterValidator, Field

from controllers import impedance
from rig.config.matrix import KindColumns, reject_end_mark
from rig.config.model import Reason, WholeNumber
from rig.row_contents import CATEGORICAL, DRIVE, PANEL, Column, X, Y

_KP, _KI, _KM = impedance.COLUMNS

Kp = Annotated[
    float,
    Field(ge=_KP.low, le=_KP.high),
    Reason(_KP.reason),
    AfterValidator(reject_end_mark),
]
"""Velocity gain of the impedance law, N*s/m."""

Ki = Annotated[float, Field(ge=_KI.low, le=_KI.high)]
"""Position gain of the impedance law, N/m; Ki > 0 acts as a negative spring."""

SpringRate = Annotated[float, Field(ge=-50_000, le=50_000)]
"""Rate of the magnetic spring alone by the rig's spring map, N/m: the slope over its half angle."""

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

_STATOR = Column("stator_percent", "stator", "%", "stator", field="spring_command.target")
_SPRING = Column(
    "spring_n_per_m", "spring_rate", "N/m", "spring rate", PANEL, "spring_command.rate", 25.0,
    "spring", actuator=_STATOR,
)  # fmt: skip
_DRIVE_LOG = "drive_command.settings"

DRIVE_COLUMNS = (
    Column("bus_voltage_v", "bus_voltage", "V", "bus voltage", DRIVE,
           f"{_DRIVE_LOG}.bus_voltage", 0.5),
    Column("switching_period_s", "switching_period", "s", "switching period", DRIVE,
           f"{_DRIVE_LOG}.switching_period", 1e-6, shown_unit="µs"),
    Column("hysteresis_a", "hysteresis_tolerance", "A", "hysteresis", DRIVE,
           f"{_DRIVE_LOG}.hysteresis_tolerance", 0.02),
    Column("velocity_threshold_m_per_s", "velocity_threshold", "m/s", "velocity threshold", DRIVE,
           f"{_DRIVE_LOG}.velocity_threshold", 0.002),
    Column("discharge_level", "discharge_level", "1", "discharge level", DRIVE,
           f"{_DRIVE_LOG}.discharge_level"),
)  # fmt: skip

COLUMNS = KindColumns(
    first=_SPRING,
    others=(
        Column("reference_scale", "reference_scale", "1", "reference scale",
               field="reference.scale", tolerance=0.005),
        Column("realisation", "realisation", "1", "realisation", CATEGORICAL),
        Column("surge_kp_n_s_per_m", "surge_kp", "N*s/m", "surge Kp",
               field="surge.demand.kp", tolerance=25.0),
        Column("surge_ki_n_per_m", "surge_ki", "N/m", "surge Ki",
               field="surge.demand.ki", tolerance=25.0),
        *DRIVE_COLUMNS,
    ),
    types={
        "spring_n_per_m": SpringRate,
        "reference_scale": ReferenceScale,
        "realisation": Realisation,
        "surge_kp_n_s_per_m": SurgeKp,
        "surge_ki_n_per_m": SurgeKi,
        "bus_voltage_v": BusVoltage,
        "switching_period_s": SwitchingPeriod,
        "hysteresis_a": HysteresisTolerance,
        "velocity_threshold_m_per_s": VelocityThreshold,
        "discharge_level": DischargeLevel,
    },
    law_details={
        _KP.key: {"role": Y, "field": "heave.demand.kp", "tolerance": 25.0},
        _KI.key: {"role": X, "field": "heave.demand.ki", "tolerance": 25.0},
        _KM.key: {"field": "heave.demand.km", "tolerance": 1.0},
    },
)  # fmt: skip
"""The columns that a matrix has, or may have, in addition to those of its law."""
