"""Predicted surge of every row: station keeping or hold in the same sea, with its own loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.config.campaign_file import CampaignFile
from rig.design import loop
from rig.design import sampled_loop as sampled
from rig.design.grid import Floats, samples_from_spectrum
from rig.design.sampled_loop import Poles
from rig.design.steady_motion import System, solve_steady_motion
from rig.kinds.wavebot.config.rig_file import RigFile, StationKeeping
from rig.kinds.wavebot.predictions import passive, plant
from rig.kinds.wavebot.predictions.axis import body_dynamic_stiffness, peak
from rig.kinds.wavebot.predictions.electrics import limiter_rms_peak
from rig.kinds.wavebot.predictions.model import CampaignModel, open_loop_force
from rig.planning.campaign.set_points import RowSetting


class SurgeResponse(NamedTuple):
    """Surge of every row, one entry per row; ``lateral_force`` is rows by samples."""

    position_peak: Floats  # m
    velocity_peak: Floats  # m/s
    force_peak: Floats  # N, demanded
    force_rms: Floats  # N
    current_peak: Floats  # A, of the demand
    current_rms_peak: Floats  # A, peak of the limiter's moving rms
    lateral_force: Floats  # N, on the heave guide
    poles: Poles | None  # None: the drive is off


def predict_surge(model: CampaignModel, settings: Sequence[RowSetting]) -> SurgeResponse:
    """Predict surge of each setting; equal settings are computed once."""
    plant_model, axis, grid = model.plant, model.surge, model.grid
    campaign, rig = model.campaign.file, model.campaign.rig
    rms_time = model.campaign.limits.surge.current_rms_time_s
    keys = [
        (setting.surge_kp, setting.surge_ki, *_reference_key(model, setting))
        for setting in settings
    ]
    unique = list(dict.fromkeys(keys))
    indices = np.array([unique.index(key) for key in keys])
    unique_settings = [settings[keys.index(key)] for key in unique]
    law, station_keeping = _law(campaign, rig, unique_settings)
    force_limit = axis.current_limit * axis.newtons_per_ampere

    def saturated_force(demand: Floats, x: Floats, v: Floats) -> Floats:
        if station_keeping is not None:
            demand = demand + soft_stop_force(station_keeping, x, v)
        return np.clip(demand, -force_limit, force_limit)

    system = System(
        body_dynamic_stiffness(axis, grid)[None, :],
        axis.excitation,
        loop.demand_response(axis.timing, law, grid.omega),
        open_loop_force(model, "surge", unique_settings),
        loop.drive_response(axis.timing, grid.omega),
        lambda x, v: passive.drag_force(axis.hull.quadratic, v),
        saturated_force,
    )
    motion = solve_steady_motion(grid, system)
    demand = motion.demand
    if station_keeping is not None:
        demand = demand + soft_stop_force(station_keeping, motion.position, motion.velocity)
    current = demand / axis.newtons_per_ampere
    acceleration = samples_from_spectrum(grid, -(grid.omega**2) * motion.spectrum)
    lateral_force = plant.guide_force(
        plant_model, motion.position, acceleration, motion.motor_force
    )
    poles = None
    if campaign.surge.use != "off":
        poles = sampled.poles(
            plant.linearised_body(axis.hull, axis.drivetrain_damping),
            axis.timing,
            law,
            np.zeros(len(unique)),
        )
        poles = Poles(*(column[indices] for column in poles))
    return SurgeResponse(
        peak(motion.position)[indices],
        peak(motion.velocity)[indices],
        peak(demand)[indices],
        np.sqrt(np.mean(demand * demand, axis=1))[indices],
        peak(current)[indices],
        limiter_rms_peak(grid.step, current, rms_time)[indices],
        lateral_force[indices],
        poles,
    )


def _reference_key(model: CampaignModel, setting: RowSetting) -> tuple[float, float]:
    """Return the part of a setting that determines the open-loop force on surge."""
    on_surge = model.reference.axis == "surge"
    return (setting.reference_scale, setting.realisation) if on_surge else (0.0, 0.0)


def soft_stop_force(station_keeping: StationKeeping, x: Floats, v: Floats) -> Floats:
    """Return the force of the soft stop on the body, N (`controllers.station_keeping`)."""
    depth = np.maximum(np.abs(x) - station_keeping.reach_m, 0.0)
    side = np.sign(x)
    inward = depth * (
        station_keeping.soft_stop_n_per_m + station_keeping.soft_stop_n_s_per_m2 * side * v
    )
    force: Floats = -side * np.maximum(inward, 0.0)
    return force


def _law(
    campaign: CampaignFile, rig: RigFile, settings: Sequence[RowSetting]
) -> tuple[loop.Law, StationKeeping | None]:
    """Return the gains of each setting, and the soft stop in station keeping."""
    zeros = np.zeros(len(settings))
    if campaign.surge.use == "off":
        return loop.Law(zeros, zeros, zeros, ()), None
    if campaign.surge.use == "hold":
        hold = rig.surge_hold
        kp, ki = zeros - hold.damping_n_s_per_m, zeros - hold.stiffness_n_per_m
        return loop.Law(kp, ki, zeros, ()), None
    kp = np.array([min(one.surge_kp, 0.0) for one in settings])
    ki = np.array([min(one.surge_ki, 0.0) for one in settings])
    return loop.Law(kp, ki, zeros, ()), rig.station_keeping
