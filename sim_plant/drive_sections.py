"""The drive sections of a plant file: the commercial drive, the custom drive, the surge drive."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from sim_plant.custom_drive import HIGHEST, LOWEST
from sim_plant.entries import Checked, Entry, Positive, Size, Time

SCHEMES = ("svpwm", "sine_triangle", "dpwm", "hysteresis")
"""Modulation schemes in the order of their codes."""

Four = Annotated[tuple[float, float, float, float], Field(strict=False)]
SetVoltage = Annotated[float, Field(ge=LOWEST.bus_voltage, le=HIGHEST.bus_voltage)]
Period = Annotated[float, Field(ge=LOWEST.switching_period, le=HIGHEST.switching_period)]
Tolerance = Annotated[float, Field(ge=LOWEST.hysteresis_tolerance, le=HIGHEST.hysteresis_tolerance)]
Mask = Annotated[int, Field(ge=LOWEST.discharge_level, le=HIGHEST.discharge_level)]


class CommandSide(Checked):
    """What every drive has: limit, current loop, enable, watchdog."""

    current_limit: Entry[Positive, Literal["A"]]
    current_time_constant: Entry[Annotated[float, Field(ge=1.0e-5, le=0.1)], Literal["s"]]
    enable_delay: Entry[Annotated[float, Field(ge=0.0, le=10.0)], Literal["s"]]
    watchdog: Entry[Time, Literal["s"]]


class CotsDrive(CommandSide):
    """Commercial drive, DC supply and power analyser."""

    kind: Literal["cots"]
    fixed_loss: Entry[Size, Literal["W"]]
    linear_loss: Entry[Size, Literal["W/A"]]
    square_loss: Entry[Size, Literal["W/A2"]]
    bus_voltage: Entry[Positive, Literal["V"]]
    bus_resistance: Entry[Size, Literal["ohm"]]
    analyser_window: Entry[Annotated[float, Field(gt=0.0, le=1.0)], Literal["s"]]


class CustomDrive(CommandSide):
    """Custom drive with its bus, and the settings it starts with."""

    kind: Literal["custom"]
    fixed_loss: Entry[Size, Literal["W"]]
    switching_loss: Entry[Size, Literal["W/kHz"]]
    ripple_loss: Entry[Size, Literal["W"]]
    conduction_loss: Entry[Size, Literal["W/A"]]
    switching_linear_loss: Entry[Size, Literal["W/A/kHz"]]
    square_loss: Entry[Size, Literal["W/A2"]]
    rated_voltage: Entry[Positive, Literal["V"]]
    inductance: Entry[Annotated[float, Field(ge=1.0e-5, le=1.0)], Literal["H"]]
    scheme_switching: Entry[Four, Literal["1"]]
    scheme_ripple: Entry[Four, Literal["1"]]
    scheme_modulation: Entry[Four, Literal["1"]]
    scheme: Entry[Literal["svpwm", "sine_triangle", "dpwm", "hysteresis"], Literal["1"]]
    bus_voltage: Entry[SetVoltage, Literal["V"]]
    switching_period: Entry[Period, Literal["s"]]
    hysteresis_tolerance: Entry[Tolerance, Literal["A"]]
    discharge_level: Entry[Mask, Literal["mask"]]
    capacitance: Entry[Annotated[float, Field(ge=0.001, le=10.0)], Literal["F"]]
    supply: Entry[Literal["connected", "disconnected"], Literal["1"]]
    supply_drop: Entry[Size, Literal["V"]]
    supply_resistance: Entry[Annotated[float, Field(gt=0.0, le=100.0)], Literal["ohm"]]
    dump_band: Entry[Annotated[float, Field(gt=0.0, le=50.0)], Literal["V"]]
    dump_resistance: Entry[Annotated[float, Field(ge=1.0, le=1.0e4)], Literal["ohm"]]
    undervoltage_share: Entry[Annotated[float, Field(ge=0.0, lt=1.0)], Literal["1"]]
    undervoltage_delay: Entry[Annotated[float, Field(ge=0.0, le=10.0)], Literal["s"]]
    brownout_voltage: Entry[Annotated[float, Field(ge=10.0, le=30.0)], Literal["V"]]
    overvoltage_trip: Entry[Positive, Literal["V"]]
    analyser_window: Entry[Annotated[float, Field(gt=0.0, le=1.0)], Literal["s"]]

    @model_validator(mode="after")
    def _is_a_bus(self) -> CustomDrive:
        """Refuse a supply quicker than the step can follow and shares that are none."""
        if self.supply_resistance.value * self.capacitance.value < 0.01:
            raise ValueError("supply_resistance times capacitance must be 0.01 s or more")
        shares = (*self.scheme_switching.value, *self.scheme_ripple.value)
        if min(shares) < 0.0 or max(shares) > 100.0:
            raise ValueError("scheme_switching and scheme_ripple must be 0 to 100")
        if min(self.scheme_modulation.value) <= 0.0 or max(self.scheme_modulation.value) > 1.0:
            raise ValueError("scheme_modulation must be above 0 and at most 1")
        return self


Drive = Annotated[CotsDrive | CustomDrive, Field(discriminator="kind")]
