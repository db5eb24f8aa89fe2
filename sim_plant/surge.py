"""The surge axis: hull and carriage on a mooring-like stiffness, driven by their own motor. Pure.

Force is on the moving mass, positive along the waves. Pitch is locked: its moment goes into the
structure. Surge reaches heave only through the friction of the heave guide.
"""

from __future__ import annotations

from typing import NamedTuple

from sim_plant import body, drive
from sim_plant.body import BodyParams, BodyState
from sim_plant.drive import DriveParams, DriveState
from sim_plant.units import Ampere, Kilogram, Metre, Newton, NewtonPerAmpere, Second


class SurgeParams(NamedTuple):
    """Surge constants; the body's `hydrostatic` is the stiffness of the mooring."""

    body: BodyParams
    drive: DriveParams
    force_per_current: NewtonPerAmpere  # Kt N
    carriage: Kilogram  # share of the mass that the heave guide does not carry


class SurgeState(NamedTuple):
    """Motion, drive, and the lateral force through the heave guide at this state."""

    body: BodyState
    drive: DriveState
    guide: Newton


def initial(params: SurgeParams, position: Metre) -> SurgeState:
    """Give the state at rest at a surge position (m), drive off."""
    start = BodyState(position, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return SurgeState(start, drive.at_rest(), guide_force(params, start, 0.0, 0.0))


def guide_force(params: SurgeParams, state: BodyState, motor: Newton, excitation: Newton) -> Newton:
    """Give the lateral force that the heave guide carries from carriage to hull, N.

    Motor and mooring act on the carriage: what they do not spend on its own inertia goes through
    the guide.
    """
    acceleration = body.acceleration(params.body, state, motor + excitation)
    return motor - params.body.hydrostatic * state.position - params.carriage * acceleration


def step(
    params: SurgeParams,
    state: SurgeState,
    current: Ampere,
    enable: int,
    fresh: int,
    excitation_now: Newton,
    excitation_next: Newton,
    dt: Second,
) -> SurgeState:
    """Advance surge by dt under a latched command, excitation linear within the step."""
    start, drive_state, _ = state
    ceiling = drive.NO_CEILING
    driven = drive.drive_step(params.drive, drive_state, current, enable, fresh, 1, 0, ceiling, dt)
    motor = params.force_per_current * driven.mean_current
    x, v = body.predict(params.body, start, excitation_now + motor, 0.5 * dt)
    applied = 0.5 * (excitation_now + excitation_next) + motor
    end = body.correct(params.body, start, x, v, applied, dt)
    return SurgeState(end, driven, guide_force(params, end, motor, excitation_next))
