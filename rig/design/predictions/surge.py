"""The surge axis of every row: station keeping or hold in the same sea, on its own loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.config.campaign_file import CampaignFile
from rig.config.rig_file import RigFile, StationKeeping
from rig.design.predictions import loop, passive, plant, sampled
from rig.design.predictions.axis import body_lines, peak
from rig.design.predictions.electrics import held
from rig.design.predictions.grid import Floats, record
from rig.design.predictions.model import Subject, has_excitation
from rig.design.predictions.sampled import Poles
from rig.design.predictions.steady import System, steady
from rig.planning.campaign.set_points import RowSetting


class Surge(NamedTuple):
    """Surge of every row, one entry a row; ``lateral`` is rows by samples."""

    position_peak: Floats  # m
    velocity_peak: Floats  # m/s
    force_peak: Floats  # N, demanded
    force_rms: Floats  # N
    current_peak: Floats  # A, what the demand takes
    current_held: Floats  # A, highest rms as the limiter averages it
    lateral: Floats  # N, through the heave guide
    poles: Poles | None  # None: no loop, the drive is off


def surge_of(subject: Subject, settings: Sequence[RowSetting]) -> Surge:
    """Surge of each setting; equal ones are worked out once."""
    given, axis, on = subject.plant, subject.surge, subject.grid
    campaign, rig = subject.campaign.file, subject.campaign.rig
    rms_time = subject.campaign.limits.surge.current_rms_time_s
    alike = [(one.surge_kp, one.surge_ki, *_force_of(subject, one)) for one in settings]
    unique = list(dict.fromkeys(alike))
    which = np.array([unique.index(each) for each in alike])
    kept = [settings[alike.index(each)] for each in unique]
    once, soft = _law(campaign, rig, kept)
    most = axis.most * axis.newtons_per_ampere

    def granted(demand: Floats, x: Floats, v: Floats) -> Floats:
        if soft is not None:
            demand = demand + soft_stop(soft, x, v)
        return np.clip(demand, -most, most)

    system = System(
        body_lines(axis, on)[None, :],
        axis.excitation,
        loop.demand(axis.timing, once, on.omega),
        has_excitation(subject, "surge", kept),
        loop.drive(axis.timing, on.omega),
        lambda x, v: passive.drag_force(axis.hull.quadratic, v),
        granted,
    )
    motion = steady(on, system)
    demand = motion.demand
    if soft is not None:
        demand = demand + soft_stop(soft, motion.position, motion.velocity)
    current = demand / axis.newtons_per_ampere
    acceleration = record(on, -(on.omega**2) * motion.lines)
    lateral = plant.guide_force(given, motion.position, acceleration, motion.motor)
    stable = None
    if campaign.surge.use != "off":
        stable = sampled.poles(
            plant.at_rest(axis.hull, axis.drivetrain), axis.timing, once, np.zeros(len(unique))
        )
        stable = Poles(*(column[which] for column in stable))
    return Surge(
        peak(motion.position)[which],
        peak(motion.velocity)[which],
        peak(demand)[which],
        np.sqrt(np.mean(demand * demand, axis=1))[which],
        peak(current)[which],
        held(on.step, current, rms_time)[which],
        lateral[which],
        stable,
    )


def _force_of(subject: Subject, one: RowSetting) -> tuple[float, float]:
    """What of a setting chooses the open-loop force on surge."""
    pushes = subject.reference.axis == "surge"
    return (one.reference_scale, one.realisation) if pushes else (0.0, 0.0)


def soft_stop(keeping: StationKeeping, x: Floats, v: Floats) -> Floats:
    """Force of the soft stop on the body, N (`controllers.station_keeping`)."""
    depth = np.maximum(np.abs(x) - keeping.reach_m, 0.0)
    side = np.sign(x)
    push = depth * (keeping.soft_stop_n_per_m + keeping.soft_stop_n_s_per_m2 * side * v)
    force: Floats = -side * np.maximum(push, 0.0)
    return force


def _law(
    campaign: CampaignFile, rig: RigFile, settings: Sequence[RowSetting]
) -> tuple[loop.Law, StationKeeping | None]:
    """Gains of each setting, and the soft stop where there is one."""
    none = np.zeros(len(settings))
    if campaign.surge.use == "off":
        return loop.Law(none, none, none, ()), None
    if campaign.surge.use == "hold":
        hold = rig.surge_hold
        kp, ki = none - hold.damping_n_s_per_m, none - hold.stiffness_n_per_m
        return loop.Law(kp, ki, none, ()), None
    kp = np.array([min(one.surge_kp, 0.0) for one in settings])
    ki = np.array([min(one.surge_ki, 0.0) for one in settings])
    return loop.Law(kp, ki, none, ()), rig.station_keeping
