"""Parameters of the simulated plant in the form that predictions use.

No other module of this package reads the plant's parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.design.grid import Floats
from rig.design.sampled_loop import Body
from rig.kinds.wavebot.predictions import electrics
from rig.kinds.wavebot.predictions.bus import Bus
from rig.kinds.wavebot.predictions.passive import Friction, Spring
from rig.planning.campaign.set_points import RowSetting
from sim_plant import building, magnetic_spring
from sim_plant.body import BodyParams
from sim_plant.bus import BusParams
from sim_plant.custom_drive import DriveSettings, InverterParams
from sim_plant.parameters import Plant
from sim_plant.wavebot import WaveBotParams


class PlantModel(NamedTuple):
    """A plant file and the parameters of its simulation step."""

    file: Plant
    params: WaveBotParams

    @property
    def has_custom_drive(self) -> bool:
        """True if the heave drive is the custom drive with its own DC bus."""
        return self.params.electrics.custom == 1


class CurrentLoop(NamedTuple):
    """Current loop of a drive."""

    lag: float  # s, time constant
    current_limit: float  # A


def build_plant_model(mapping: object) -> PlantModel:
    """Build the plant from a merged mapping that has already been checked."""
    file = Plant.model_validate(mapping)
    return PlantModel(file, file.build())


def delay_ticks(plant: PlantModel) -> int:
    """Return the ticks from a sensor's sample to the loop's reading."""
    return int(plant.file.sensors.delay_ticks.value)


def surge_bem(plant: PlantModel, heave_bem: Path) -> Path:
    """Return the path of the surge BEM file, in the folder of the heave file."""
    return heave_bem.with_name(plant.file.surge.bem)


def stator_speed(plant: PlantModel) -> float:
    """Return the speed of the stator actuator, % per second."""
    return plant.params.spring.speed


def stator_start(plant: PlantModel) -> float:
    """Return the initial stator position of the simulation, %."""
    return float(plant.file.stator.start.value)


def current_loop(plant: PlantModel, axis: str) -> CurrentLoop:
    """Return the current loop of the heave or surge drive."""
    loop = plant.params.electrics.drive if axis == "heave" else plant.params.surge.drive
    return CurrentLoop(loop.time_constant, loop.current_limit)


def motor(plant: PlantModel) -> electrics.Motor:
    """Return the heave motor."""
    pto = plant.params.pto
    emf = float(np.sqrt(1.5)) * pto.force_per_current
    return electrics.Motor(pto.force_per_current, pto.copper, emf, pto.copper * emf * emf)


def hull(plant: PlantModel, axis: str) -> tuple[BodyParams, float]:
    """Return the hull in heave or surge and the viscous damping of its drivetrain, N*s/m."""
    if axis == "heave":
        return plant.params.body, plant.params.pto.viscous
    return plant.params.surge.body, 0.0


def linearised_body(params: BodyParams, drivetrain_damping: float) -> Body:
    """Return the hull linearised about rest, for the computation of poles."""
    return Body(
        params.inertia,
        params.viscous + drivetrain_damping,
        params.hydrostatic,
        (params.a0, params.a1, params.a2, params.a3, params.a4),
        (params.b1, params.b2, params.b3, params.b4),
    )


def spring(plant: PlantModel, stator: Sequence[float]) -> Spring:
    """Return the magnetic spring with its effective rate at each stator position (%)."""
    params = plant.params.spring
    rates = [magnetic_spring.table_rate(params, position) for position in stator]
    return Spring(
        np.array(rates)[:, None], params.force_per_rate, params.angle_per_metre, params.sine
    )


def friction(plant: PlantModel, lateral_force: Floats | None) -> Friction:
    """Return the drivetrain's Coulomb friction under a lateral force in the guide (N)."""
    pto = plant.params.pto
    size = np.array(pto.coulomb)
    if lateral_force is not None:
        size = size + pto.guide_friction * np.abs(lateral_force)
    return Friction(size, pto.coulomb_velocity)


def guide_force(plant: PlantModel, position: Floats, acceleration: Floats, force: Floats) -> Floats:
    """Return the lateral force on the heave guide, N (`sim_plant.surge.guide_force`)."""
    surge = plant.params.surge
    return force - surge.body.hydrostatic * position - surge.carriage_mass * acceleration


def to_drive_settings(setting: RowSetting, scheme: int) -> DriveSettings:
    """Return the custom drive's settings at a set point."""
    return DriveSettings(
        scheme,
        setting.bus_voltage,
        setting.switching_period,
        setting.hysteresis_tolerance,
        int(setting.discharge_level),
    )


def drive(
    plant: PlantModel,
    settings: Sequence[RowSetting],
    scheme: int,
    gating_current: float,
    voltage: Floats,
) -> electrics.Drive:
    """Return losses and voltage limit of the heave drive at each setting.

    ``gating_current`` (A) is the current below which the power stage may switch off; ``voltage``
    (V, one per row) is the bus voltage. The commercial drive ignores both.
    """
    zeros = np.zeros((len(settings), 1))
    if not plant.has_custom_drive:
        cots = plant.params.electrics.cots
        return electrics.Drive(
            zeros + cots.fixed_loss,
            zeros,
            zeros + cots.linear_loss,
            zeros + cots.square_loss,
            zeros + electrics.NO_VOLTAGE_LIMIT,
            zeros,
            zeros,
        )
    columns = [
        _losses(_electrics_params(plant, one, scheme)[0], float(volt))
        for one, volt in zip(settings, voltage, strict=True)
    ]
    fixed, active, linear, quadratic, voltage_limit = (
        np.array(column)[:, None] for column in zip(*columns, strict=True)
    )
    gating_velocity = np.array([one.velocity_threshold for one in settings])[:, None]
    return electrics.Drive(
        fixed, active, linear, quadratic, voltage_limit, gating_velocity, zeros + gating_current
    )


def bus(plant: PlantModel, setting: RowSetting, scheme: int) -> Bus:
    """Return the DC bus of the custom drive at a setting."""
    params = _electrics_params(plant, setting, scheme)[1]
    return Bus(
        params.capacitance,
        params.set_voltage,
        params.supply_connected,
        params.supply_voltage,
        params.supply_resistance,
        params.dump_on,
        params.dump_off,
        params.dump_conductance,
        params.undervoltage,
        params.overvoltage,
    )


def idle_power(plant: PlantModel) -> float:
    """Return the power that the heave drive draws while it is off, W."""
    electrics_params = plant.params.electrics
    return (
        electrics_params.inverter.fixed_loss
        if plant.has_custom_drive
        else electrics_params.cots.fixed_loss
    )


def standby_power(plant: PlantModel, setting: RowSetting, scheme: int) -> float:
    """Return the custom drive's power while it is on at rest, W, at the set voltage."""
    inverter, bus_params = _electrics_params(plant, setting, scheme)
    fixed, active, *_ = _losses(inverter, bus_params.set_voltage)
    return fixed if setting.velocity_threshold > 0.0 else fixed + active


def bus_at_rest(plant: PlantModel, setting: RowSetting) -> float:
    """Return the voltage of the DC bus before any motion, V."""
    return (
        setting.bus_voltage if plant.has_custom_drive else plant.params.electrics.cots.bus_voltage
    )


def commercial_bus_voltage(plant: PlantModel, power_dc: Floats) -> Floats:
    """Return the commercial drive's bus voltage, V (`sim_plant.cots_drive.bus_voltage`)."""
    cots = plant.params.electrics.cots
    voltage: Floats = cots.bus_voltage - cots.bus_resistance * power_dc / cots.bus_voltage
    return voltage


def _electrics_params(
    plant: PlantModel, setting: RowSetting, scheme: int
) -> tuple[InverterParams, BusParams]:
    settings = to_drive_settings(setting, scheme)
    params = building.electrics_params(plant.file.drive, plant.file.pto, settings)
    return params.inverter, params.bus


def _losses(params: InverterParams, voltage: float) -> tuple[float, float, float, float, float]:
    """Return fixed, active, linear and quadratic loss and the voltage limit of `electrics.Drive`.

    Their sum equals `sim_plant.custom_drive.loss`.
    """
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
