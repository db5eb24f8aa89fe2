"""Passive forces of the plant over records, row by row: vectorised forms of `sim_plant`."""

from collections.abc import Sequence

import numpy as np

from rig.design.grid import Floats
from rig.kinds.wavebot.config.rig_file import StationKeeping
from sim_plant.magnetic_spring import SpringParams, table_rate
from sim_plant.pto import PtoParams
from sim_plant.surge import SurgeParams


def spring_rates(spring: SpringParams, stator: Sequence[float]) -> Floats:
    """Return the spring's effective rate at each stator position (%), N/m, rows by 1."""
    return np.array([table_rate(spring, position) for position in stator])[:, None]


def spring_force(spring: SpringParams, rates: Floats, x: Floats) -> Floats:
    """Return the spring force on the body, N (`sim_plant.magnetic_spring.force`)."""
    if spring.sine == 0:
        return -rates * x
    return -rates * spring.force_per_rate * np.sin(2.0 * spring.angle_per_metre * x)


def spring_stiffness(spring: SpringParams, rates: Floats) -> Floats:
    """Return the spring's stiffness at rest, N/m, one value per row."""
    factor = 2.0 * spring.force_per_rate * spring.angle_per_metre if spring.sine == 1 else 1.0
    return rates[:, 0] * factor


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
