"""Losses and current limit of the custom drive, an inverter with settable modulation. Pure.

P_loss = fixed + [on] (a f s u + h r u² + (c + b f s u)|i| + q i²), u = V/V0, f in kHz: switching
loss, ripple loss, conduction and switching loss per ampere, resistance. s and h belong to the
modulation scheme; the hysteresis scheme switches at V/(4 L tolerance).
"""

from __future__ import annotations

from typing import NamedTuple

from sim_plant.units import (
    Ampere,
    Code,
    Kilohertz,
    KilohertzPerVolt,
    MetrePerSecond,
    Ohm,
    Ratio,
    Second,
    Volt,
    VoltSecondPerMetre,
    Watt,
    WattPerAmpere,
    WattPerAmpereKilohertz,
    WattPerAmpereSquared,
    WattPerKilohertz,
)

SVPWM, SINE_TRIANGLE, DPWM, HYSTERESIS = 0, 1, 2, 3


class DriveSettings(NamedTuple):
    """Drive settings that an operator rarely changes; MASK4 report (Sandia), Tables 3-2 and 3-3."""

    scheme: Code  # 0 SVPWM, 1 sine-triangle, 2 DPWM, 3 hysteresis
    bus_voltage: Volt  # set point of the DC bus
    switching_period: Second  # of the PWM schemes
    hysteresis_tolerance: Ampere  # of the hysteresis scheme
    discharge_level: Code  # bit mask of the four dump resistors: 1 selects one, 15 all


# Allowed range of each setting, ends included.
MIN_SETTINGS = DriveSettings(SVPWM, 30.0, 2.0e-5, 0.05, 0)
MAX_SETTINGS = DriveSettings(HYSTERESIS, 180.0, 1.0e-3, 10.0, 15)


class InverterParams(NamedTuple):
    """Loss and modulation parameters under the present settings."""

    fixed_loss: Watt  # logic: drawn with the power stage on or off
    switching_loss: WattPerKilohertz
    ripple_loss: Watt  # times the scheme's h
    conduction_loss: WattPerAmpere
    switching_linear_loss: WattPerAmpereKilohertz
    square_loss: WattPerAmpereSquared
    rated_voltage: Volt  # V0
    frequency: Kilohertz  # part that does not depend on the bus voltage
    frequency_per_volt: KilohertzPerVolt
    switching_share: Ratio  # s of the scheme
    modulation: Ratio  # largest phase-to-phase rms over bus voltage, of the scheme
    back_emf: VoltSecondPerMetre  # sqrt(3/2) Kt N
    resistance: Ohm  # of a winding
    drive_current: Ratio  # drive current over two-port current: sqrt(3/2)


def check_settings(settings: DriveSettings) -> None:
    """Raise ValueError with the name and range of every setting that is out of range."""
    limits = zip(DriveSettings._fields, settings, MIN_SETTINGS, MAX_SETTINGS, strict=True)
    problems = [
        f"{name} {value!r} is out of range; allowed {low:g} to {high:g}"
        for name, value, low, high in limits
        if not low <= value <= high
    ]
    if problems:
        raise ValueError("; ".join(problems))


def loss(params: InverterParams, voltage: Volt, current: Ampere, on: int) -> Watt:
    """Return the loss between the drive's DC and AC terminals at a bus voltage, W.

    `on` is 1 while the power stage switches; otherwise only the fixed loss applies.
    """
    if on == 0:
        return params.fixed_loss
    voltage_ratio = voltage / params.rated_voltage
    frequency = params.frequency + params.frequency_per_volt * voltage
    switching_rate = frequency * params.switching_share * voltage_ratio
    magnitude = abs(current)
    per_ampere = (
        params.conduction_loss
        + params.switching_linear_loss * switching_rate
        + params.square_loss * magnitude
    )
    no_load_loss = (
        params.switching_loss * switching_rate + params.ripple_loss * voltage_ratio * voltage_ratio
    )
    return params.fixed_loss + no_load_loss + per_ampere * magnitude


def max_current(params: InverterParams, voltage: Volt, velocity: MetrePerSecond) -> Ampere:
    """Return the largest drive current that the bus voltage allows, A, not negative.

    The motor needs |94.27 v| + R |i| (two-port quantities, magnitudes in both quadrants); the
    modulation provides a fraction of the bus voltage. Above the no-load speed the torque is zero:
    the uncontrolled rectification of the freewheeling diodes is not modelled.
    """
    available_voltage = params.modulation * voltage - params.back_emf * abs(velocity)
    if not available_voltage > 0.0:
        return 0.0
    return params.drive_current * available_voltage / params.resistance
