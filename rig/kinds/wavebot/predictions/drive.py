"""The heave drive over records: current and voltage limits, losses, powers at the stations.

Powers are means of products over the record itself, so |i| and i^2 need no assumption about the
distribution of the current. Absorbed power is negative.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.design.grid import Floats
from rig.design.twoport.network import Motor
from rig.kinds.wavebot.campaign.set_points import RowSetting
from sim_plant import building
from sim_plant.cots_drive import CotsParams
from sim_plant.custom_drive import DriveSettings, InverterParams
from sim_plant.electrics import ElectricsParams
from sim_plant.parameters import Plant

NO_VOLTAGE_LIMIT = 1e9  # V


class Drive(NamedTuple):
    """Motor, limits and losses of the drive; the losses are arrays of rows by 1.

    P = fixed + [on] (active + linear |i| + quadratic i^2)
    """

    motor: Motor
    current_limit: float  # A, peak
    gating_current: float  # A: the power stage is only off at lower current; 0: at any current
    gating_velocity: Floats  # m/s: and only at lower speed; 0: never off
    fixed: Floats  # W
    active: Floats  # W, while the power stage switches
    linear: Floats  # W/A
    quadratic: Floats  # W/A^2
    voltage_limit: Floats  # V, largest motor voltage; NO_VOLTAGE_LIMIT: not limited


def electrics_at(plant: Plant, setting: RowSetting, scheme: int) -> ElectricsParams:
    """Return drive and bus of the plant at a set point; a commercial drive has no settings."""
    settings = DriveSettings(
        scheme,
        setting.bus_voltage,
        setting.switching_period,
        setting.hysteresis_tolerance,
        int(setting.discharge_level),
    )
    return building.electrics_params(plant.drive, plant.pto, settings)


def build_drive(
    plant: Plant,
    settings: Sequence[RowSetting],
    scheme: int,
    current_limit: float,
    gating_current: float,
    voltage: Floats,
) -> Drive:
    """Return the heave drive at each setting.

    The custom drive has the modulation ``scheme``, the ``gating_current`` (A) and the bus
    ``voltage`` (V, one per row). The commercial drive ignores them.
    """
    rows = [
        losses(electrics_at(plant, setting, scheme), float(volt))
        for setting, volt in zip(settings, voltage, strict=True)
    ]
    gating_velocity = np.array([setting.velocity_threshold for setting in settings])[:, None]
    return Drive(
        motor(plant),
        current_limit,
        gating_current,
        gating_velocity,
        *(np.array(column)[:, None] for column in zip(*rows, strict=True)),
    )


def motor(plant: Plant) -> Motor:
    """Return the heave motor."""
    pto = plant.pto
    return Motor(pto.torque_constant.value, pto.gear_ratio.value, pto.winding_resistance.value)


def losses(electrics: ElectricsParams, voltage: float) -> tuple[float, float, float, float, float]:
    """Return fixed, active, linear and quadratic loss and the voltage limit of `Drive`.

    Their sum equals `sim_plant.custom_drive.loss` or `sim_plant.cots_drive.loss`.
    """
    if electrics.custom == 0:
        cots: CotsParams = electrics.cots
        return (cots.fixed_loss, 0.0, cots.linear_loss, cots.square_loss, NO_VOLTAGE_LIMIT)
    params: InverterParams = electrics.inverter
    voltage_ratio = voltage / params.rated_voltage
    switched = (params.frequency + params.frequency_per_volt * voltage) * params.switching_share
    switched = switched * voltage_ratio
    return (
        params.fixed_loss,
        params.switching_loss * switched + params.ripple_loss * voltage_ratio * voltage_ratio,
        params.conduction_loss + params.switching_linear_loss * switched,
        params.square_loss,
        params.modulation * voltage,
    )


def is_conducting(drive: Drive, force: Floats, velocity: Floats) -> Floats:
    """Return 1 where the power stage switches (`controllers.drive_gating`, no hysteresis)."""
    force_threshold = drive.gating_current * drive.motor.newtons_per_ampere
    low_current = (np.abs(force) < force_threshold) | (force_threshold == 0.0)
    return np.where(low_current & (np.abs(velocity) < drive.gating_velocity), 0.0, 1.0)


def current_limited_force(drive: Drive, demand: Floats, velocity: Floats) -> Floats:
    """Return the demanded force after current limit and gating, N."""
    force_limit = drive.current_limit * drive.motor.newtons_per_ampere
    force = np.clip(demand, -force_limit, force_limit)
    if np.any(drive.gating_velocity > 0.0):
        force = force * is_conducting(drive, demand, velocity)
    return force


def voltage_limited_force(drive: Drive, command: Floats, velocity: Floats) -> Floats:
    """Return the commanded force after the limit of the bus voltage, N."""
    if not np.any(drive.voltage_limit < NO_VOLTAGE_LIMIT):
        return command
    emf = drive.motor.transduction
    voltage_headroom = np.maximum(drive.voltage_limit - emf * np.abs(velocity), 0.0)
    force_limit = emf * voltage_headroom / drive.motor.resistance
    return np.clip(command, -force_limit, force_limit)


def station_powers(
    drive: Drive,
    force: Floats,
    demand: Floats,
    velocity: Floats,
    passive_force: Floats,
    estimated_velocity: Floats,
) -> tuple[dict[str, Floats], Floats]:
    """Return the mean power of each row by station, and the record of the DC power, W.

    ``passive_force`` is that of the drivetrain (N on the body). ``estimated_velocity`` is the rig's
    estimate, from which it computes mechanical power, ahead by the lag of the force sensors.
    """
    ac = force * velocity + drive.motor.copper * force * force
    current = np.abs(force) / drive.motor.newtons_per_ampere
    loss = drive.fixed + is_conducting(drive, demand, velocity) * (
        drive.active + (drive.linear + drive.quadratic * current) * current
    )
    records = {
        "mechanical_1": (force + passive_force) * estimated_velocity,
        "mechanical_2": force * estimated_velocity,
        "ac": ac,
        "dc": ac + loss,
    }
    return {name: record.mean(axis=1) for name, record in records.items()}, records["dc"]


def required_voltage(motor: Motor, velocity: Floats, force: Floats) -> Floats:
    """Return the voltage that the motor needs, V: back-EMF plus winding, for either power sign."""
    winding = motor.resistance * np.abs(force) / motor.transduction
    return motor.transduction * np.abs(velocity) + winding


def commercial_bus_voltage(cots: CotsParams, power_dc: Floats) -> Floats:
    """Return the commercial drive's bus voltage, V (`sim_plant.cots_drive.bus_voltage`)."""
    return cots.bus_voltage - cots.bus_resistance * power_dc / cots.bus_voltage
