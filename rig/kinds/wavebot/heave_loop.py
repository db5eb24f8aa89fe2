"""The sampled loop of heave about rest: body, delays, gains, and how long its transients last.

After the waves have begun, or after a change of gains, what is left of the transient are the modes
of this loop, in which the states of radiation stand for the waves that the body has radiated
before. The slowest one decides. Drag and friction, which the modes lack, shorten it.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from controllers.signals import Gains
from rig.config.rig_file import Axis
from rig.design import sampled_loop
from rig.design.axis import Body, Law, Timing
from rig.design.axis_params import estimator_params
from rig.design.grid import Floats
from rig.design.law_params import law_params, zc_sections
from rig.design.linear_form import NotLinearError, linear_gains
from sim_plant.body import BodyParams
from sim_plant.magnetic_spring import SpringParams, table_rate
from sim_plant.parameters import Plant
from sim_plant.parts.drive import DriveParams

REMAINDER = 0.01  # of the amplitude of a transient


def transients(campaign: Any, rows: Sequence[Any]) -> list[float]:
    """Return the times after which `REMAINDER` of the transients of each row is left, s.

    They include the ramp of the gains, and are infinite for a law without a linear form.
    """
    rig = campaign.rig
    plant, dt = Plant.model_validate(campaign.plant), 1.0 / rig.rate_hz
    params = plant.build()
    try:
        law = heave_law(campaign, [row.setting for row in rows], dt)
    except NotLinearError:
        return [math.inf] * len(rows)
    rates = spring_rates(params.spring, [row.place for row in rows])
    decay = sampled_loop.decay_times(
        linear_body(params.body, params.pto.viscous),
        loop_timing(plant, params.electrics.drive, rig.heave, dt),
        law,
        spring_stiffness(params.spring, rates),
    )
    return [rig.heave.gain_ramp_s - math.log(REMAINDER) * each for each in decay.tolist()]


def loop_timing(plant: Plant, drive: DriveParams, motor: Axis, dt: float) -> Timing:
    """Return the delays of the loop of an axis with such a ``motor`` and ``drive``."""
    delay_ticks = int(plant.sensors.delay_ticks.value)
    return Timing(dt, delay_ticks, drive.time_constant, estimator_params(motor, dt))


def linear_body(hull: BodyParams, damping: float) -> Body:
    """Return a hull linearised about rest, with a linear ``damping`` (N*s/m) in addition."""
    return Body(
        hull.inertia,
        hull.viscous + damping,
        hull.hydrostatic,
        (hull.a0, hull.a1, hull.a2, hull.a3, hull.a4),
        (hull.b1, hull.b2, hull.b3, hull.b4),
    )


def row_gains(campaign: Any, setting: Any, dt: float) -> Gains:
    """Return the gains of a row's set point; NotLinearError if its law has none."""
    law = campaign.file.heave_law
    if campaign.file.zc_law is not None:
        return Gains(setting.kp, setting.ki, setting.km)
    params: Any = law_params(law, campaign.file.law, campaign.rig.heave.gain_ramp_s, dt)
    return linear_gains(law, params, law.set_point(setting))


def heave_law(campaign: Any, settings: Sequence[Any], dt: float) -> Law:
    """Return the heave law of each setting; NotLinearError if it has no linear form."""
    kp, ki, km = np.array([row_gains(campaign, one, dt) for one in settings]).T
    return Law(kp, ki, km, zc_sections(campaign.file.law, dt))


def spring_rates(spring: SpringParams, stator: Sequence[float]) -> Floats:
    """Return the spring's effective rate at each stator position (%), N/m, rows by 1."""
    return np.array([table_rate(spring, position) for position in stator])[:, None]


def spring_stiffness(spring: SpringParams, rates: Floats) -> Floats:
    """Return the spring's stiffness at rest, N/m, one value per row."""
    factor = 2.0 * spring.force_per_rate * spring.angle_per_metre if spring.sine == 1 else 1.0
    return rates[:, 0] * factor
