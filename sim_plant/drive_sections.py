"""The drive sections of a plant file: the commercial drive, the custom drive, the surge drive."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from sim_plant.custom_drive import MAX_SETTINGS, MIN_SETTINGS
from sim_plant.entries import Entry, NonNegative, Positive, StrictModel, Time

SCHEMES = ("svpwm", "sine_triangle", "dpwm", "hysteresis")
"""Modulation schemes in the order of their codes."""

PerScheme = Annotated[tuple[float, float, float, float], Field(strict=False)]
SetVoltage = Annotated[float, Field(ge=MIN_SETTINGS.bus_voltage, le=MAX_SETTINGS.bus_voltage)]
Period = Annotated[float, Field(ge=MIN_SETTINGS.switching_period, le=MAX_SETTINGS.switching_period)]
Tolerance = Annotated[
    float, Field(ge=MIN_SETTINGS.hysteresis_tolerance, le=MAX_SETTINGS.hysteresis_tolerance)
]
DischargeMask = Annotated[
    int, Field(ge=MIN_SETTINGS.discharge_level, le=MAX_SETTINGS.discharge_level)
]


class DriveControl(StrictModel):
    """Parameters of every drive: current limit, current loop, enable, watchdog."""

    current_limit: Entry[Positive, Literal["A"]]
    current_time_constant: Entry[Annotated[float, Field(ge=1.0e-5, le=0.1)], Literal["s"]]
    enable_delay: Entry[Annotated[float, Field(ge=0.0, le=10.0)], Literal["s"]]
    watchdog: Entry[Time, Literal["s"]]


class CotsDrive(DriveControl):
    """Commercial drive, DC supply and power analyser."""

    kind: Literal["cots"]
    fixed_loss: Entry[NonNegative, Literal["W"]]
    linear_loss: Entry[NonNegative, Literal["W/A"]]
    square_loss: Entry[NonNegative, Literal["W/A2"]]
    bus_voltage: Entry[Positive, Literal["V"]]
    bus_resistance: Entry[NonNegative, Literal["ohm"]]
    analyser_window: Entry[Annotated[float, Field(gt=0.0, le=1.0)], Literal["s"]]


class CustomDrive(DriveControl):
    """Custom drive with its bus and its initial settings."""

    kind: Literal["custom"]
    fixed_loss: Entry[NonNegative, Literal["W"]]
    switching_loss: Entry[NonNegative, Literal["W/kHz"]]
    ripple_loss: Entry[NonNegative, Literal["W"]]
    conduction_loss: Entry[NonNegative, Literal["W/A"]]
    switching_linear_loss: Entry[NonNegative, Literal["W/A/kHz"]]
    square_loss: Entry[NonNegative, Literal["W/A2"]]
    rated_voltage: Entry[Positive, Literal["V"]]
    inductance: Entry[Annotated[float, Field(ge=1.0e-5, le=1.0)], Literal["H"]]
    scheme_switching: Entry[PerScheme, Literal["1"]]
    scheme_ripple: Entry[PerScheme, Literal["1"]]
    scheme_modulation: Entry[PerScheme, Literal["1"]]
    scheme: Entry[Literal["svpwm", "sine_triangle", "dpwm", "hysteresis"], Literal["1"]]
    bus_voltage: Entry[SetVoltage, Literal["V"]]
    switching_period: Entry[Period, Literal["s"]]
    hysteresis_tolerance: Entry[Tolerance, Literal["A"]]
    discharge_level: Entry[DischargeMask, Literal["mask"]]
    capacitance: Entry[Annotated[float, Field(ge=0.001, le=10.0)], Literal["F"]]
    supply: Entry[Literal["connected", "disconnected"], Literal["1"]]
    supply_drop: Entry[NonNegative, Literal["V"]]
    supply_resistance: Entry[Annotated[float, Field(gt=0.0, le=100.0)], Literal["ohm"]]
    dump_band: Entry[Annotated[float, Field(gt=0.0, le=50.0)], Literal["V"]]
    dump_resistance: Entry[Annotated[float, Field(ge=1.0, le=1.0e4)], Literal["ohm"]]
    undervoltage_share: Entry[Annotated[float, Field(ge=0.0, lt=1.0)], Literal["1"]]
    undervoltage_delay: Entry[Annotated[float, Field(ge=0.0, le=10.0)], Literal["s"]]
    brownout_voltage: Entry[Annotated[float, Field(ge=10.0, le=30.0)], Literal["V"]]
    overvoltage_trip: Entry[Positive, Literal["V"]]
    analyser_window: Entry[Annotated[float, Field(gt=0.0, le=1.0)], Literal["s"]]

    @model_validator(mode="after")
    def _check_ranges(self) -> CustomDrive:
        """Reject a supply time constant too short for the step, and scheme factors out of range."""
        if self.supply_resistance.value * self.capacitance.value < 0.01:
            raise ValueError("supply_resistance times capacitance must be 0.01 s or more")
        shares = (*self.scheme_switching.value, *self.scheme_ripple.value)
        if min(shares) < 0.0 or max(shares) > 100.0:
            raise ValueError("scheme_switching and scheme_ripple must be 0 to 100")
        if min(self.scheme_modulation.value) <= 0.0 or max(self.scheme_modulation.value) > 1.0:
            raise ValueError("scheme_modulation must be above 0 and at most 1")
        return self


Drive = Annotated[CotsDrive | CustomDrive, Field(discriminator="kind")]
