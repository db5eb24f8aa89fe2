"""The surge axis: hull and carriage on a mooring-like stiffness, with a motor of their own. Pure.

Force is on the moving mass, positive along the waves. Pitch is locked: the structure carries its
moment. Surge reaches heave only through the friction of the heave guide.
"""

from __future__ import annotations

from typing import NamedTuple

from sim_plant import body
from sim_plant.body import BodyParams, BodyState
from sim_plant.parts import drive
from sim_plant.parts.drive import DriveParams, DriveState
from sim_plant.units import Ampere, Kilogram, Metre, Newton, NewtonPerAmpere, Second


class SurgeParams(NamedTuple):
    """Surge parameters; the body's `hydrostatic` is the stiffness of the mooring."""

    body: BodyParams
    drive: DriveParams
    force_per_current: NewtonPerAmpere  # Kt N
    carriage_mass: Kilogram  # part of the mass that is not behind the heave guide


class SurgeState(NamedTuple):
    """Motion, drive, and the lateral force through the heave guide at this state."""

    body: BodyState
    drive: DriveState
    guide_force: Newton


def initial(params: SurgeParams, position: Metre) -> SurgeState:
    """Return the state at rest at a surge position (m), drive off."""
    body_state = BodyState(position, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return SurgeState(body_state, drive.initial(), guide_force(params, body_state, 0.0, 0.0))


def guide_force(params: SurgeParams, state: BodyState, motor: Newton, excitation: Newton) -> Newton:
    """Return the lateral force that the heave guide transmits from carriage to hull, N.

    Motor and mooring act on the carriage; the guide transmits their sum minus the carriage's
    inertia force.
    """
    acceleration = body.acceleration(params.body, state, motor + excitation)
    return motor - params.body.hydrostatic * state.position - params.carriage_mass * acceleration


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
    body_state, drive_state, _ = state
    max_current = drive.UNLIMITED_CURRENT
    next_drive = drive.drive_step(
        params.drive, drive_state, current, enable, fresh, 1, 0, max_current, dt
    )
    motor = params.force_per_current * next_drive.mean_current
    x, v = body.predict(params.body, body_state, excitation_now + motor, 0.5 * dt)
    applied = 0.5 * (excitation_now + excitation_next) + motor
    end = body.correct(params.body, body_state, x, v, applied, dt)
    return SurgeState(end, next_drive, guide_force(params, end, motor, excitation_next))
