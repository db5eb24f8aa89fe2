"""From the sections of a plant file to the constants of the step, as real floats."""

from __future__ import annotations

import math

from sim_plant import sections
from sim_plant.body import BodyParams
from sim_plant.bus import BusParams
from sim_plant.cots_drive import CotsParams
from sim_plant.custom_drive import HYSTERESIS, DriveSettings, InverterParams
from sim_plant.drive import DriveParams
from sim_plant.drive_sections import SCHEMES, CommandSide, CotsDrive, CustomDrive
from sim_plant.electrics import ElectricsParams
from sim_plant.entries import Radiation
from sim_plant.magnetic_spring import SpringParams
from sim_plant.pto import PtoParams
from sim_plant.sensors import Channel, SensorParams
from sim_plant.stator_force import StatorForceParams
from sim_plant.surge import SurgeParams

NO_COTS = CotsParams(0.0, 0.0, 0.0, 1.0, 0.0)
NO_INVERTER = InverterParams(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0)
NO_BUS = BusParams(1.0, 0.0, 0, 0.0, 1.0, 0.0, 0.0, 0.0, 0, 0.0, 0.0, 0.0, 0.0)


def fit_slope(half_angle: float) -> float:
    """Give the least-squares slope of sin 2 theta over ±half_angle (rad): 1.649 at 39.27 deg."""
    arch = 0.5 * math.sin(2.0 * half_angle) - half_angle * math.cos(2.0 * half_angle)
    return 1.5 * arch / (half_angle * half_angle * half_angle)


def body(file: sections.Body) -> BodyParams:
    """Give the heave constants."""
    return BodyParams(
        float(file.mass.value) + float(file.added_mass_infinite.value),
        float(file.hydrostatic.value),
        float(file.viscous_linear.value),
        float(file.viscous_quadratic.value),
        *_radiation(file.radiation),
    )


def surge(file: sections.Surge, motor: sections.Pto) -> SurgeParams:
    """Give the surge constants; its motor and gear are those of heave."""
    hull = BodyParams(
        float(file.mass.value) + float(file.added_mass_infinite.value),
        float(file.stiffness.value),
        float(file.viscous_linear.value),
        float(file.viscous_quadratic.value),
        *_radiation(file.radiation),
    )
    return SurgeParams(
        hull, _command_side(file.drive), _force_per_current(motor), float(file.carriage_mass.value)
    )


def pto(file: sections.Pto) -> PtoParams:
    """Give motor and drivetrain constants."""
    force_per_current = _force_per_current(file)
    return PtoParams(
        force_per_current,
        file.winding_resistance.value / (1.5 * force_per_current * force_per_current),
        float(file.drivetrain_viscous.value),
        float(file.drivetrain_coulomb.value),
        float(file.guide_friction.value),
        float(file.coulomb_velocity.value),
    )


def spring(file: sections.Spring, stator: sections.Stator) -> SpringParams:
    """Give table and torque law of the magnetic spring."""
    lever = float(file.lever.value)
    return SpringParams(
        1.0 / lever,
        lever / fit_slope(file.fit_half_angle.value),
        1 if file.law.value == "sine" else 0,
        float(file.spring_effect.value),
        tuple(float(station) for station in file.stator_positions.value),
        tuple(float(rate) for rate in file.spring_rates.value),
        100.0 * stator.speed.value / stator.travel.value,
    )


def stator_force(file: sections.Spring, stator: sections.Stator) -> StatorForceParams:
    """Give the axial side of the magnetic spring; Tp of a linear spring is half its slope."""
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


def electrics(
    file: CotsDrive | CustomDrive, motor: sections.Pto, settings: DriveSettings | None
) -> ElectricsParams:
    """Give drive, bus and analyser constants; settings are those of the file unless given."""
    loop, window = _command_side(file), float(file.analyser_window.value)
    if isinstance(file, CotsDrive):
        losses = CotsParams(
            float(file.fixed_loss.value),
            float(file.linear_loss.value),
            float(file.square_loss.value),
            float(file.bus_voltage.value),
            float(file.bus_resistance.value),
        )
        return ElectricsParams(loop, 0, losses, NO_INVERTER, NO_BUS, window)
    chosen = settings or DriveSettings(
        SCHEMES.index(file.scheme.value),
        float(file.bus_voltage.value),
        float(file.switching_period.value),
        float(file.hysteresis_tolerance.value),
        file.discharge_level.value,
    )
    inverter, link = _inverter(file, motor, chosen), _bus(file, chosen)
    return ElectricsParams(loop, 1, NO_COTS, inverter, link, window)


def sensors(file: sections.Sensors, motor: sections.Pto) -> SensorParams:
    """Give scales and errors; strides differ so that no two channels share their noise."""
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
    )


def probe_channel(file: sections.Sensors) -> Channel:
    """Give the errors of the basin probes."""
    return Channel(0.0, float(file.probe_noise.value), float(file.probe_resolution.value), 29, 7001)


def _radiation(file: Radiation) -> tuple[float, ...]:
    num = [float(b) for b in file.numerator.value]
    den = [float(a) for a in file.denominator.value]
    return (*reversed(den), *reversed(num))


def _force_per_current(file: sections.Pto) -> float:
    return float(file.torque_constant.value * file.gear_ratio.value)


def _command_side(file: CommandSide) -> DriveParams:
    return DriveParams(
        float(file.current_limit.value),
        float(file.current_time_constant.value),
        float(file.enable_delay.value),
        float(file.watchdog.value),
    )


def _inverter(file: CustomDrive, motor: sections.Pto, chosen: DriveSettings) -> InverterParams:
    two_port = math.sqrt(1.5)
    fixed, per_volt = 0.001 / chosen.switching_period, 0.0
    if chosen.scheme == HYSTERESIS:
        swing = 4.0 * file.inductance.value * chosen.hysteresis_tolerance
        fixed, per_volt = 0.0, 0.001 / swing
    return InverterParams(
        float(file.fixed_loss.value),
        float(file.switching_loss.value),
        float(file.ripple_loss.value * file.scheme_ripple.value[chosen.scheme]),
        float(file.conduction_loss.value),
        float(file.switching_linear_loss.value),
        float(file.square_loss.value),
        float(file.rated_voltage.value),
        fixed,
        per_volt,
        float(file.scheme_switching.value[chosen.scheme]),
        float(file.scheme_modulation.value[chosen.scheme]),
        two_port * _force_per_current(motor),
        float(motor.winding_resistance.value),
        two_port,
    )


def _bus(file: CustomDrive, chosen: DriveSettings) -> BusParams:
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
