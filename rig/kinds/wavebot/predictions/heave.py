"""Predicted heave of every row: motion, current, power at the stations, poles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.design import loop
from rig.design import sampled_loop as sampled
from rig.design.grid import Floats, samples_from_spectrum
from rig.design.sampled_loop import Poles
from rig.design.steady_motion import CONVERGED, System, solve_steady_motion
from rig.kinds.wavebot.predictions import electrics, passive, plant
from rig.kinds.wavebot.predictions.axis import body_dynamic_stiffness, peak
from rig.kinds.wavebot.predictions.model import (
    CampaignModel,
    drive_switching,
    heave_law,
    open_loop_force,
)
from rig.planning.campaign.set_points import RowSetting


class HeaveResponse(NamedTuple):
    """Heave of every row, one entry per row; ``dc_power`` is rows by samples."""

    columns: dict[str, Floats]  # keys are fields of `RowPredictions`
    converged: list[bool]  # the last iteration changed the motion by less than `CONVERGED`
    dc_power: Floats  # W, into the drive


def predict_heave(
    model: CampaignModel,
    settings: Sequence[RowSetting],
    stator: Sequence[float],
    lateral_force: Floats | None,
    voltage: Floats,
) -> HeaveResponse:
    """Predict heave of each setting at its stator position (%).

    ``lateral_force`` (N, rows by samples) acts on the guide; ``voltage`` (V, one per row) is the
    custom drive's bus voltage.
    """
    plant_model, grid, axis, motor = model.plant, model.grid, model.heave, model.motor
    law = heave_law(model, settings)
    spring = plant.spring(plant_model, stator)
    friction = plant.friction(plant_model, lateral_force)
    scheme, gating_current = drive_switching(model)
    drive = plant.drive(plant_model, settings, scheme, gating_current, voltage)

    def passive_force(x: Floats, v: Floats) -> Floats:
        spring_and_friction = passive.spring_force(spring, x) + passive.friction_force(friction, v)
        return spring_and_friction + passive.drag_force(axis.hull.quadratic, v)

    def saturated_force(demand: Floats, x: Floats, v: Floats) -> Floats:
        command = electrics.current_limited_force(drive, motor, axis.current_limit, demand, v)
        return electrics.voltage_limited_force(drive, motor, command, v)

    system = System(
        body_dynamic_stiffness(axis, grid)[None, :],
        axis.excitation,
        loop.demand_response(axis.timing, law, grid.omega),
        open_loop_force(model, "heave", settings),
        loop.drive_response(axis.timing, grid.omega),
        passive_force,
        saturated_force,
    )
    motion = solve_steady_motion(grid, system)
    x, v = motion.position, motion.velocity
    drivetrain_force = passive.spring_force(spring, x) + passive.friction_force(friction, v)
    drivetrain_force = drivetrain_force - axis.drivetrain_damping * v
    estimated_velocity = samples_from_spectrum(
        grid, loop.estimator_response(axis.timing, grid.omega).velocity * motion.spectrum
    )
    power = electrics.station_powers(
        drive, motor, motion.motor_force, motion.demand, v, drivetrain_force, estimated_velocity
    )
    command = electrics.current_limited_force(drive, motor, axis.current_limit, motion.demand, v)
    current = command / axis.newtons_per_ampere
    rms_time = model.campaign.limits.heave.current_rms_time_s
    columns = {
        "position_peak": peak(x),
        "position_rms": _rms(x),
        "stroke": np.ptp(x, axis=1),
        "velocity_peak": peak(v),
        "force_peak": peak(command),
        "force_rms": _rms(command),
        "current_peak": peak(motion.demand) / axis.newtons_per_ampere,
        "current_rms": _rms(current),
        "current_rms_peak": electrics.limiter_rms_peak(grid.step, current, rms_time),
        "power_mechanical_1": power.mechanical_1,
        "power_mechanical_2": power.mechanical_2,
        "power_ac": power.ac,
        "power_dc": power.dc,
        "voltage_required": electrics.required_voltage(motor, v, motion.demand).max(axis=1),
        "voltage_available": drive.voltage_limit[:, 0],
    }
    return HeaveResponse(columns, (motion.change < CONVERGED).tolist(), power.dc_record)


def heave_poles(
    model: CampaignModel, settings: Sequence[RowSetting], stator: Sequence[float]
) -> Poles:
    """Return the poles of the sampled heave loop at each setting."""
    axis = model.heave
    stiffness = passive.stiffness_at_rest(plant.spring(model.plant, stator))
    body = plant.linearised_body(axis.hull, axis.drivetrain_damping)
    return sampled.poles(body, axis.timing, heave_law(model, settings), stiffness)


def _rms(values: Floats) -> Floats:
    rms: Floats = np.sqrt(np.mean(values * values, axis=1))
    return rms
