"""The simulated plant in the words of a prediction; nothing else here reads its parameters."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rig.design.predictions import electrics
from rig.design.predictions.bus import Bus
from rig.design.predictions.grid import Floats
from rig.design.predictions.passive import Friction, Spring
from rig.design.predictions.sampled import Body
from rig.planning.campaign.set_points import RowSetting
from sim_plant import building, magnetic_spring
from sim_plant.body import BodyParams
from sim_plant.bus import BusParams
from sim_plant.custom_drive import DriveSettings, InverterParams
from sim_plant.parameters import Plant
from sim_plant.wavebot import WaveBotParams


class Given(NamedTuple):
    """A plant file, and the constants of its step."""

    file: Plant
    built: WaveBotParams

    @property
    def custom(self) -> bool:
        """True if the heave drive is the custom one, with a bus of its own."""
        return self.built.electrics.custom == 1


class Side(NamedTuple):
    """The command side of a drive."""

    lag: float  # s, of the current loop
    most: float  # A


def given(mapping: object) -> Given:
    """The plant of a merged mapping that was checked before."""
    file = Plant.model_validate(mapping)
    return Given(file, file.build())


def delay_ticks(plant: Given) -> int:
    """Ticks from a sensor's sample to the loop's reading."""
    return int(plant.file.sensors.delay_ticks.value)


def surge_bem(plant: Given, heave: Path) -> Path:
    """The BEM file of surge, beside that of heave."""
    return heave.with_name(plant.file.surge.bem)


def stator_speed(plant: Given) -> float:
    """Speed of the stator actuator, % a second."""
    return plant.built.spring.speed


def stator_start(plant: Given) -> float:
    """Where the simulated stator stands at first, %."""
    return float(plant.file.stator.start.value)


def side(plant: Given, axis: str) -> Side:
    """Current loop of the heave or the surge drive."""
    loop = plant.built.electrics.loop if axis == "heave" else plant.built.surge.drive
    return Side(loop.time_constant, loop.current_limit)


def motor(plant: Given) -> electrics.Motor:
    """The heave motor."""
    pto = plant.built.pto
    emf = float(np.sqrt(1.5)) * pto.force_per_current
    return electrics.Motor(pto.force_per_current, pto.copper, emf, pto.copper * emf * emf)


def hull(plant: Given, axis: str) -> tuple[BodyParams, float]:
    """The hull in heave or surge, and the viscous damping of its drivetrain, N*s/m."""
    if axis == "heave":
        return plant.built.body, plant.built.pto.viscous
    return plant.built.surge.body, 0.0


def at_rest(params: BodyParams, drivetrain: float) -> Body:
    """A hull about rest, for its poles."""
    return Body(
        params.inertia,
        params.viscous + drivetrain,
        params.hydrostatic,
        (params.a0, params.a1, params.a2, params.a3, params.a4),
        (params.b1, params.b2, params.b3, params.b4),
    )


def spring(plant: Given, stator: Sequence[float]) -> Spring:
    """The magnetic spring at each stator position (%), at the rate that acts there."""
    params = plant.built.spring
    rates = [magnetic_spring.table_rate(params, position) for position in stator]
    return Spring(np.array(rates)[:, None], params.reach, params.angle_per_metre, params.sine)


def friction(plant: Given, lateral: Floats | None) -> Friction:
    """The drivetrain's Coulomb friction under a lateral force in the guide, N."""
    pto = plant.built.pto
    size = np.array(pto.coulomb)
    if lateral is not None:
        size = size + pto.guide * np.abs(lateral)
    return Friction(size, pto.coulomb_velocity)


def guide_force(plant: Given, position: Floats, acceleration: Floats, force: Floats) -> Floats:
    """Lateral force that the heave guide carries, N (`sim_plant.surge.guide_force`)."""
    surge = plant.built.surge
    return force - surge.body.hydrostatic * position - surge.carriage * acceleration


def settings_of(setting: RowSetting, scheme: int) -> DriveSettings:
    """What the custom drive is told of a set point."""
    return DriveSettings(
        scheme,
        setting.bus_voltage,
        setting.switching_period,
        setting.hysteresis_tolerance,
        int(setting.discharge_level),
    )


def drive(
    plant: Given, settings: Sequence[RowSetting], scheme: int, within: float, voltage: Floats
) -> electrics.Drive:
    """Losses and voltage of the heave drive at each setting.

    ``within`` (A) is the current below which it may rest, ``voltage`` (V, one a row) that of the
    bus; neither matters to the commercial drive.
    """
    none = np.zeros((len(settings), 1))
    if not plant.custom:
        cots = plant.built.electrics.cots
        return electrics.Drive(
            none + cots.fixed_loss,
            none,
            none + cots.linear_loss,
            none + cots.square_loss,
            none + electrics.NO_CEILING,
            none,
            none,
        )
    columns = [
        _losses(_fitted(plant, one, scheme)[0], float(volt))
        for one, volt in zip(settings, voltage, strict=True)
    ]
    fixed, standing, linear, square, most = (
        np.array(column)[:, None] for column in zip(*columns, strict=True)
    )
    below = np.array([one.velocity_threshold for one in settings])[:, None]
    return electrics.Drive(fixed, standing, linear, square, most, below, none + within)


def bus(plant: Given, setting: RowSetting, scheme: int) -> Bus:
    """The DC bus of the custom drive at a setting."""
    params = _fitted(plant, setting, scheme)[1]
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


def idle_power(plant: Given) -> float:
    """What the heave drive draws while it is off, W."""
    built = plant.built.electrics
    return built.inverter.fixed_loss if plant.custom else built.cots.fixed_loss


def standing_power(plant: Given, setting: RowSetting, scheme: int) -> float:
    """What the heave drive draws while it is on and nothing moves, W; custom drive, set voltage."""
    inverter, link = _fitted(plant, setting, scheme)
    fixed, standing, *_ = _losses(inverter, link.set_voltage)
    return fixed if setting.velocity_threshold > 0.0 else fixed + standing


def bus_at_rest(plant: Given, setting: RowSetting) -> float:
    """Voltage of the DC bus before anything moves, V."""
    return setting.bus_voltage if plant.custom else plant.built.electrics.cots.bus_voltage


def stiff_bus(plant: Given, power_dc: Floats) -> Floats:
    """Voltage of the commercial drive's bus, V (`sim_plant.cots_drive.bus_voltage`)."""
    cots = plant.built.electrics.cots
    voltage: Floats = cots.bus_voltage - cots.bus_resistance * power_dc / cots.bus_voltage
    return voltage


def _fitted(plant: Given, setting: RowSetting, scheme: int) -> tuple[InverterParams, BusParams]:
    told = settings_of(setting, scheme)
    params = building.electrics(plant.file.drive, plant.file.pto, told)
    return params.inverter, params.bus


def _losses(params: InverterParams, voltage: float) -> tuple[float, float, float, float, float]:
    """Fixed, standing, linear and square loss and the voltage limit, as `electrics.Drive` has them.

    The sum is that of `sim_plant.custom_drive.loss`.
    """
    part = voltage / params.rated_voltage
    switched = (params.frequency + params.frequency_per_volt * voltage) * params.switching_share
    switched = switched * part
    return (
        params.fixed_loss,
        params.switching_loss * switched + params.ripple_loss * part * part,
        params.conduction_loss + params.switching_linear_loss * switched,
        params.square_loss,
        params.modulation * voltage,
    )
