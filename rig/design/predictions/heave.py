"""Heave of every row: motion, current, power at the stations, poles."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rig.design.predictions import electrics, loop, passive, plant, sampled
from rig.design.predictions.axis import body_lines, peak
from rig.design.predictions.grid import Floats, record
from rig.design.predictions.model import Subject, has_excitation, law_of, switching
from rig.design.predictions.sampled import Poles
from rig.design.predictions.steady import SETTLED, System, steady
from rig.planning.campaign.set_points import RowSetting


class Heave(NamedTuple):
    """Heave of every row, one entry a row; ``dc`` is rows by samples."""

    columns: dict[str, Floats]  # by the names of `rig.design.predictions.row_prediction.Foreseen`
    settled: list[bool]  # the motion was found to within `SETTLED`
    dc: Floats  # W, into the drive


def heave_of(
    subject: Subject,
    settings: Sequence[RowSetting],
    stator: Sequence[float],
    lateral: Floats | None,
    voltage: Floats,
) -> Heave:
    """Heave of each setting at its stator position (%).

    ``lateral`` (N, rows by samples) is the force in the guide, ``voltage`` (V, one a row) that of
    the custom drive's bus.
    """
    given, on, axis, motor = subject.plant, subject.grid, subject.heave, subject.motor
    law = law_of(subject, settings)
    spring = plant.spring(given, stator)
    friction = plant.friction(given, lateral)
    scheme, within = switching(subject)
    drive = plant.drive(given, settings, scheme, within, voltage)

    def force(x: Floats, v: Floats) -> Floats:
        held = passive.spring_force(spring, x) + passive.friction_force(friction, v)
        return held + passive.drag_force(axis.hull.quadratic, v)

    def granted(demand: Floats, x: Floats, v: Floats) -> Floats:
        command = electrics.commanded(drive, motor, axis.most, demand, v)
        return electrics.granted(drive, motor, command, v)

    system = System(
        body_lines(axis, on)[None, :],
        axis.excitation,
        loop.demand(axis.timing, law, on.omega),
        has_excitation(subject, "heave", settings),
        loop.drive(axis.timing, on.omega),
        force,
        granted,
    )
    motion = steady(on, system)
    x, v = motion.position, motion.velocity
    between = passive.spring_force(spring, x) + passive.friction_force(friction, v)
    between = between - axis.drivetrain * v
    seen = record(on, loop.estimated(axis.timing, on.omega).velocity * motion.lines)
    power = electrics.stations(drive, motor, motion.motor, motion.demand, v, between, seen)
    command = electrics.commanded(drive, motor, axis.most, motion.demand, v)
    current = command / axis.newtons_per_ampere
    rms_time = subject.campaign.limits.heave.current_rms_time_s
    columns = {
        "position_peak": peak(x),
        "position_rms": _rms(x),
        "stroke": np.ptp(x, axis=1),
        "velocity_peak": peak(v),
        "force_peak": peak(command),
        "force_rms": _rms(command),
        "current_peak": peak(motion.demand) / axis.newtons_per_ampere,
        "current_rms": _rms(current),
        "current_held": electrics.held(on.step, current, rms_time),
        "power_mechanical_1": power.mechanical_1,
        "power_mechanical_2": power.mechanical_2,
        "power_ac": power.ac,
        "power_dc": power.dc,
        "voltage_need": electrics.need(motor, v, motion.demand).max(axis=1),
        "voltage_given": drive.ceiling[:, 0],
    }
    return Heave(columns, (motion.change < SETTLED).tolist(), power.dc_record)


def heave_poles(subject: Subject, settings: Sequence[RowSetting], stator: Sequence[float]) -> Poles:
    """Poles of the sampled heave loop at each setting."""
    axis = subject.heave
    small = passive.small_rate(plant.spring(subject.plant, stator))
    body = plant.at_rest(axis.hull, axis.drivetrain)
    return sampled.poles(body, axis.timing, law_of(subject, settings), small)


def _rms(values: Floats) -> Floats:
    rms: Floats = np.sqrt(np.mean(values * values, axis=1))
    return rms
