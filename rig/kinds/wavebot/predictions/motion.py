"""Predicted heave and surge of some rows: motion, current, power at the stations, poles.

The passive forces of the plant are vectorised forms of `sim_plant`, over records, row by row.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.design import estimator, sampled_loop
from rig.design.axis import Law, moving_rms_peak, peak, rms, solve_axis
from rig.design.grid import Floats, samples_from_spectrum
from rig.design.steady_motion import CONVERGED
from rig.kinds.wavebot.campaign.set_points import RowSetting
from rig.kinds.wavebot.config.rig_file import StationKeeping
from rig.kinds.wavebot.heave_loop import spring_rates, spring_stiffness
from rig.kinds.wavebot.predictions import drive as drives
from rig.kinds.wavebot.predictions.model import CampaignModel, open_loop_force
from sim_plant.magnetic_spring import SpringParams
from sim_plant.pto import PtoParams
from sim_plant.surge import SurgeParams

Columns = dict[str, Floats]
"""Fields of `RowPredictions`, one value per row."""


class Batch(NamedTuple):
    """Some rows, and their results that do not depend on the bus."""

    settings: list[RowSetting]
    stator: list[float]  # %
    law: Law
    columns: Columns
    lateral_force: Floats  # N, on the heave guide


class HeaveMotion(NamedTuple):
    """Heave of every row."""

    columns: Columns
    converged: list[bool]  # the last iteration changed the motion by less than `CONVERGED`
    dc_power: Floats  # W, into the drive, rows by samples


class SurgeMotion(NamedTuple):
    """Surge of every row: station keeping or hold in the same sea, with its own loop."""

    columns: Columns
    lateral_force: Floats  # N, on the heave guide, rows by samples


def predict_heave(model: CampaignModel, batch: Batch, voltage: Floats) -> HeaveMotion:
    """Predict heave of a batch; ``voltage`` (V, one per row) is that of the custom drive's bus."""
    settings = batch.settings
    grid, axis, spring, pto = model.grid, model.heave, model.params.spring, model.params.pto
    rates = spring_rates(spring, batch.stator)
    friction = friction_size(pto, batch.lateral_force)
    drive = drives.build_drive(
        model.plant, settings, model.scheme, axis.current_limit, model.gating_current, voltage
    )

    def passive_force(x: Floats, v: Floats) -> Floats:
        return spring_force(spring, rates, x) + friction_force(pto, friction, v)

    def command_force(demand: Floats, v: Floats) -> Floats:
        return drives.current_limited_force(drive, demand, v)

    motion = solve_axis(
        grid,
        axis,
        batch.law,
        open_loop_force(model, "heave", settings),
        passive_force,
        lambda demand, x, v: drives.voltage_limited_force(drive, command_force(demand, v), v),
    )
    x, v = motion.position, motion.velocity
    estimate = estimator.response(axis.timing.estimator, grid.omega, axis.timing.dt)
    # The mean of a lagging force times velocity is that of the force times a velocity ahead of it.
    ahead = 1.0 / (1.0 - 1j * grid.omega * model.params.sensors.heave_force_lag)
    powers, dc_power = drives.station_powers(
        drive,
        motion.motor_force,
        motion.demand,
        v,
        passive_force(x, v) - pto.viscous * v,
        samples_from_spectrum(grid, ahead * estimate.velocity * motion.spectrum),
    )
    command = command_force(motion.demand, v)
    current = command / axis.newtons_per_ampere
    rms_time = model.campaign.limits.heave.current_rms_time_s
    columns = {
        "position_peak": peak(x),
        "position_rms": rms(x),
        "stroke": np.ptp(x, axis=1),
        "velocity_peak": peak(v),
        "force_peak": peak(command),
        "force_rms": rms(command),
        "current_peak": peak(motion.demand) / axis.newtons_per_ampere,
        "current_rms": rms(current),
        "current_rms_peak": moving_rms_peak(grid.step, current, rms_time),
        **{f"power_{station}": power for station, power in powers.items()},
        "voltage_required": drives.required_voltage(drive.motor, v, motion.demand).max(axis=1),
        "voltage_available": drive.voltage_limit[:, 0],
    }
    return HeaveMotion(columns, (motion.change < CONVERGED).tolist(), dc_power)


def heave_poles(model: CampaignModel, stator: Sequence[float], law: Law) -> Columns:
    """Return the poles of the sampled heave loop at each row's gains."""
    spring = model.params.spring
    stiffness = spring_stiffness(spring, spring_rates(spring, stator))
    poles = sampled_loop.poles(model.heave.body, model.heave.timing, law, stiffness)
    return {
        "spectral_radius": poles.radius,
        "gain_margin": poles.gain_margin,
        "decay_time": poles.decay_time,
    }


def predict_surge(model: CampaignModel, settings: Sequence[RowSetting]) -> SurgeMotion:
    """Predict surge of each setting; equal settings are computed once."""
    axis, grid = model.surge, model.grid
    rms_time = model.campaign.limits.surge.current_rms_time_s
    on_surge = model.reference.axis == "surge"
    keys = [
        (one.surge_kp, one.surge_ki, *((one.reference_scale, one.realisation) if on_surge else ()))
        for one in settings
    ]
    unique = list(dict.fromkeys(keys))
    unique_settings = [settings[keys.index(key)] for key in unique]
    law, station_keeping = _surge_law(model, unique_settings)
    force_limit = axis.current_limit * axis.newtons_per_ampere

    def with_soft_stop(demand: Floats, x: Floats, v: Floats) -> Floats:
        if station_keeping is None:
            return demand
        return demand + soft_stop_force(station_keeping, x, v)

    motion = solve_axis(
        grid,
        axis,
        law,
        open_loop_force(model, "surge", unique_settings),
        lambda x, v: 0.0 * x,
        lambda demand, x, v: np.clip(with_soft_stop(demand, x, v), -force_limit, force_limit),
    )
    demand = with_soft_stop(motion.demand, motion.position, motion.velocity)
    current = demand / axis.newtons_per_ampere
    acceleration = samples_from_spectrum(grid, -(grid.omega**2) * motion.spectrum)
    columns = {
        "surge_position_peak": peak(motion.position),
        "surge_velocity_peak": peak(motion.velocity),
        "surge_force_peak": peak(demand),
        "surge_force_rms": rms(demand),
        "surge_current_peak": peak(current),
        "surge_current_rms_peak": moving_rms_peak(grid.step, current, rms_time),
    }
    if model.campaign.file.surge.use != "off":
        poles = sampled_loop.poles(axis.body, axis.timing, law, np.zeros(len(unique)))
        columns["surge_spectral_radius"] = poles.radius
        columns["surge_gain_margin"] = poles.gain_margin
    lateral_force = guide_force(
        model.params.surge, motion.position, acceleration, motion.motor_force
    )
    index_of = {key: index for index, key in enumerate(unique)}
    indices = [index_of[key] for key in keys]
    return SurgeMotion(
        {name: column[indices] for name, column in columns.items()}, lateral_force[indices]
    )


def _surge_law(
    model: CampaignModel, settings: Sequence[RowSetting]
) -> tuple[Law, StationKeeping | None]:
    """Return the gains of each setting, and the soft stop in station keeping."""
    use, rig, zeros = model.campaign.file.surge.use, model.campaign.rig, np.zeros(len(settings))
    if use == "off":
        return Law(zeros, zeros, zeros, ()), None
    if use == "hold":
        hold = rig.surge_hold
        kp, ki = zeros - hold.damping_n_s_per_m, zeros - hold.stiffness_n_per_m
        return Law(kp, ki, zeros, ()), None
    kp = np.array([min(one.surge_kp, 0.0) for one in settings])
    ki = np.array([min(one.surge_ki, 0.0) for one in settings])
    return Law(kp, ki, zeros, ()), rig.station_keeping


def spring_force(spring: SpringParams, rates: Floats, x: Floats) -> Floats:
    """Return the spring force on the body, N (`sim_plant.magnetic_spring.force`)."""
    if spring.sine == 0:
        return -rates * x
    return -rates * spring.force_per_rate * np.sin(2.0 * spring.angle_per_metre * x)


def friction_size(pto: PtoParams, lateral_force: Floats) -> Floats:
    """Return the drivetrain's Coulomb friction under a lateral force in the guide, N."""
    return pto.coulomb + pto.guide_friction * np.abs(lateral_force)


def friction_force(pto: PtoParams, size: Floats, v: Floats) -> Floats:
    """Return Coulomb friction of a ``size`` (N) on the body, N (`sim_plant.pto.friction`)."""
    return -size * np.tanh(v / pto.coulomb_velocity)


def guide_force(
    surge: SurgeParams, position: Floats, acceleration: Floats, force: Floats
) -> Floats:
    """Return the lateral force on the heave guide, N (`sim_plant.surge.guide_force`)."""
    return force - surge.body.hydrostatic * position - surge.carriage_mass * acceleration


def soft_stop_force(station_keeping: StationKeeping, x: Floats, v: Floats) -> Floats:
    """Return the force of the soft stop on the body, N (`controllers.station_keeping`)."""
    depth = np.maximum(np.abs(x) - station_keeping.reach_m, 0.0)
    side = np.sign(x)
    inward = depth * (
        station_keeping.soft_stop_n_per_m + station_keeping.soft_stop_n_s_per_m2 * side * v
    )
    return -side * np.maximum(inward, 0.0)
