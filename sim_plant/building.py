"""Conversion of the sections of a plant file to the parameters of the step, as floats."""

from __future__ import annotations

import math

from sim_plant import sections
from sim_plant.body import BodyParams
from sim_plant.cots_drive import CotsParams
from sim_plant.custom_drive import HYSTERESIS, DriveSettings, InverterParams
from sim_plant.drive_sections import SCHEMES, CotsDrive, CustomDrive, DriveControl
from sim_plant.electrics import ElectricsParams
from sim_plant.entries import Radiation
from sim_plant.magnetic_spring import SpringParams, fit_slope
from sim_plant.parts.bus import BusParams
from sim_plant.parts.drive import DriveParams
from sim_plant.pto import PtoParams
from sim_plant.sensors import Channel, SensorParams
from sim_plant.stator_force import StatorForceParams
from sim_plant.surge import SurgeParams

NO_COTS = CotsParams(0.0, 0.0, 0.0, 1.0, 0.0)
NO_INVERTER = InverterParams(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0)
NO_BUS = BusParams(1.0, 0.0, 0, 0.0, 1.0, 0.0, 0.0, 0.0, 0, 0.0, 0.0, 0.0, 0.0)


def body_params(file: sections.Body) -> BodyParams:
    """Return the heave parameters."""
    return BodyParams(
        float(file.mass.value) + float(file.added_mass_infinite.value),
        float(file.hydrostatic.value),
        float(file.viscous_linear.value),
        float(file.viscous_quadratic.value),
        *_radiation_coefficients(file.radiation),
    )


def surge_params(file: sections.Surge, motor: sections.Pto) -> SurgeParams:
    """Return the surge parameters; motor and gear are the same as in heave."""
    hull = BodyParams(
        float(file.mass.value) + float(file.added_mass_infinite.value),
        float(file.stiffness.value),
        float(file.viscous_linear.value),
        float(file.viscous_quadratic.value),
        *_radiation_coefficients(file.radiation),
    )
    return SurgeParams(
        hull, _drive_params(file.drive), _force_per_current(motor), float(file.carriage_mass.value)
    )


def pto_params(file: sections.Pto) -> PtoParams:
    """Return the motor and drivetrain parameters."""
    force_per_current = _force_per_current(file)
    return PtoParams(
        force_per_current,
        file.winding_resistance.value / (1.5 * force_per_current * force_per_current),
        float(file.drivetrain_viscous.value),
        float(file.drivetrain_coulomb.value),
        float(file.guide_friction.value),
        float(file.coulomb_velocity.value),
    )


def spring_params(file: sections.Spring, stator: sections.Stator) -> SpringParams:
    """Return the rate table and torque law of the magnetic spring."""
    lever = float(file.lever.value)
    return SpringParams(
        1.0 / lever,
        lever / fit_slope(file.fit_half_angle.value),
        1 if file.law.value == "sine" else 0,
        float(file.spring_effect.value),
        tuple(float(position) for position in file.stator_positions.value),
        tuple(float(rate) for rate in file.spring_rates.value),
        100.0 * stator.speed.value / stator.travel.value,
    )


def stator_force_params(file: sections.Spring, stator: sections.Stator) -> StatorForceParams:
    """Return the spring's axial-force parameters; Tp of a linear spring is half its slope."""
    lever = float(file.lever.value)
    sine = file.law.value == "sine"
    amplitude = 1.0 / fit_slope(file.fit_half_angle.value) if sine else 0.5
    return StatorForceParams(
        1 if sine else 0,
        lever * lever * amplitude,
        100.0 / stator.travel.value,
        float(file.stator_pull.value),
        float(file.slew_lever.value),
        float(file.stator_share_a.value),
    )


def electrics_params(
    file: CotsDrive | CustomDrive, motor: sections.Pto, settings: DriveSettings | None
) -> ElectricsParams:
    """Return drive, bus and analyser parameters; `settings` overrides the settings of the file."""
    drive, window = _drive_params(file), float(file.analyser_window.value)
    if isinstance(file, CotsDrive):
        losses = CotsParams(
            float(file.fixed_loss.value),
            float(file.linear_loss.value),
            float(file.square_loss.value),
            float(file.bus_voltage.value),
            float(file.bus_resistance.value),
        )
        return ElectricsParams(drive, 0, losses, NO_INVERTER, NO_BUS, window)
    drive_settings = settings or DriveSettings(
        SCHEMES.index(file.scheme.value),
        float(file.bus_voltage.value),
        float(file.switching_period.value),
        float(file.hysteresis_tolerance.value),
        file.discharge_level.value,
    )
    inverter, bus = _inverter_params(file, motor, drive_settings), _bus_params(file, drive_settings)
    return ElectricsParams(drive, 1, NO_COTS, inverter, bus, window)


def sensor_params(file: sections.Sensors, motor: sections.Pto) -> SensorParams:
    """Return encoder scales and channel errors; each channel has its own stride in the noise."""
    force = float(file.force_resolution.value)
    pot = (file.string_pot_bias, file.string_pot_noise, file.string_pot_resolution)
    bias, noise, resolution = (float(entry.value) for entry in pot)
    current = (float(file.current_noise.value), float(file.current_resolution.value))
    stator = float(file.stator_noise.value)
    return SensorParams(
        motor.gear_ratio.value / (2.0 * math.pi) * file.encoder_counts.value,
        file.encoder_offset.value,
        file.surge_encoder_offset.value,
        Channel(0.0, *current, 1, 0),
        Channel(0.0, *current, 13, 100003),
        Channel(bias, noise, resolution, 3, 20011),
        Channel(float(file.lcb_bias.value), float(file.lcb_noise.value), force, 5, 40009),
        Channel(float(file.trs_bias.value), float(file.trs_noise.value), force, 7, 60013),
        Channel(float(file.slew_bias.value), float(file.slew_noise.value), force, 17, 110017),
        Channel(float(file.stator_a_bias.value), stator, force, 19, 120011),
        Channel(float(file.stator_b_bias.value), stator, force, 23, 5003),
        Channel(0.0, float(file.rotor_noise.value), 0.0, 11, 80021),
        float(file.heave_force_lag.value),
    )


def probe_channel(file: sections.Sensors) -> Channel:
    """Return the channel errors of the basin probes."""
    return Channel(0.0, float(file.probe_noise.value), float(file.probe_resolution.value), 29, 7001)


def _radiation_coefficients(file: Radiation) -> tuple[float, ...]:
    num = [float(b) for b in file.numerator.value]
    den = [float(a) for a in file.denominator.value]
    return (*reversed(den), *reversed(num))


def _force_per_current(file: sections.Pto) -> float:
    return float(file.torque_constant.value * file.gear_ratio.value)


def _drive_params(file: DriveControl) -> DriveParams:
    return DriveParams(
        float(file.current_limit.value),
        float(file.current_time_constant.value),
        float(file.enable_delay.value),
        float(file.watchdog.value),
    )


def _inverter_params(
    file: CustomDrive, motor: sections.Pto, chosen: DriveSettings
) -> InverterParams:
    two_port_scale = math.sqrt(1.5)
    fixed_frequency, frequency_per_volt = 0.001 / chosen.switching_period, 0.0
    if chosen.scheme == HYSTERESIS:
        flux_swing = 4.0 * file.inductance.value * chosen.hysteresis_tolerance
        fixed_frequency, frequency_per_volt = 0.0, 0.001 / flux_swing
    return InverterParams(
        float(file.fixed_loss.value),
        float(file.switching_loss.value),
        float(file.ripple_loss.value * file.scheme_ripple.value[chosen.scheme]),
        float(file.conduction_loss.value),
        float(file.switching_linear_loss.value),
        float(file.square_loss.value),
        float(file.rated_voltage.value),
        fixed_frequency,
        frequency_per_volt,
        float(file.scheme_switching.value[chosen.scheme]),
        float(file.scheme_modulation.value[chosen.scheme]),
        two_port_scale * _force_per_current(motor),
        float(motor.winding_resistance.value),
        two_port_scale,
    )


def _bus_params(file: CustomDrive, chosen: DriveSettings) -> BusParams:
    level, band = float(chosen.bus_voltage), float(file.dump_band.value)
    resistors = bin(chosen.discharge_level).count("1")
    return BusParams(
        float(file.capacitance.value),
        level,
        1 if file.supply.value == "connected" else 0,
        level - file.supply_drop.value,
        float(file.supply_resistance.value),
        level + band,
        level - band,
        resistors / file.dump_resistance.value,
        chosen.discharge_level,
        file.undervoltage_share.value * level,
        float(file.brownout_voltage.value),
        float(file.overvoltage_trip.value),
        float(file.undervoltage_delay.value),
    )
