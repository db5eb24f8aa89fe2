"""Periodic motion of one axis: equivalent linearisation, with the remainder added as a force.

    D(jw) X = F_exc + F_passive(x, v) + A(jw) sat(L(jw) X + R)

D is the linear body, L the loop from true position to demanded force, R an additional open-loop
force, A the drive from saturated demand to motor force. Over the record of one period, the
nonlinear terms are written as

    F_passive = -B v - K x + r,     sat(d) = g d + q

B, K and g are the least-squares equivalents over the same record (8/(3 pi) c V for the drag of a
sine, the Gaussian moments for many waves, the record's own values for a given sea). Each iteration
solves the linear problem with B, K and g line by line and adds r and q as forces. It ends when the
motion converges. Equivalent linearisation alone would set r = q = 0.

Sources: Roberts and Spanos, Random Vibration and Statistical Linearization, ch. 4 and 5; Folley
and Whittaker 2010 (Coastal Engineering 57, 892) for wave energy converters; Cameron and Griffin
1989 (J. Appl. Mech. 56, 149) for the remainder, evaluated in the time domain and balanced in the
frequency domain.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rig.design.grid import (
    Complexes,
    Floats,
    Grid,
    samples_from_spectrum,
    spectrum_from_samples,
)

PassiveForce = Callable[[Floats, Floats], Floats]
"""Force (N) of positions (m) and velocities (m/s), rows by samples."""

Saturation = Callable[[Floats, Floats, Floats], Floats]
"""Saturated force (N) of demands (N), positions and velocities, rows by samples."""

TOLERANCE = 1e-4  # relative change of the motion's rms at which the iteration ends
CONVERGED = 0.01  # relative change in the last iteration below which a motion counts as converged
MAX_ITERATIONS = 60
TINY = 1e-30
# N*s/m, added to the linear damping in the initial motion. Friction and drag are unknown before
# there is a motion, and without damping a motion near resonance would be unbounded. The converged
# motion does not depend on this value.
FIRST_DAMPING = 500.0


class System(NamedTuple):
    """Equations of motion of one axis, one row per setting, all in the same sea."""

    body: Complexes  # D, N/m: rows by lines
    excitation: Complexes  # N: lines
    loop: Complexes  # L, N per metre of true position: rows by lines
    reference: Complexes  # R, N: rows by lines
    drive: Complexes  # A: lines
    passive_force: PassiveForce
    saturation: Saturation


class Motion(NamedTuple):
    """Periodic motion of every row, arrays of rows by samples."""

    spectrum: Complexes  # of the position
    position: Floats  # m
    velocity: Floats  # m/s
    demand: Floats  # N, before limits
    motor_force: Floats  # N, on the body
    change: Floats  # relative, of the motion's rms in the last iteration, one value per row
    iterations: int


def solve_steady_motion(grid: Grid, system: System) -> Motion:
    """Return the motion that repeats with the sea, for every row."""
    rows = system.loop.shape[0]
    j_omega = 1j * grid.omega
    zeros = np.zeros((rows, grid.samples))
    if not (np.any(system.excitation) or np.any(system.reference)):
        zero_spectrum = np.zeros((rows, grid.omega.size), dtype=np.complex128)
        return Motion(zero_spectrum, zeros, zeros, zeros, zeros, np.zeros(rows), 0)
    feedback = system.drive * system.loop
    stiffness = _stiffness_at_rest(system.passive_force, zeros)
    force = system.excitation + system.drive * system.reference
    motion = force / (system.body + j_omega * FIRST_DAMPING + stiffness - feedback)
    relaxation = np.ones((rows, 1))
    change = np.full((rows, 1), np.inf)
    iterations = 0
    while iterations < MAX_ITERATIONS:
        iterations += 1
        new_motion = _iterate(grid, system, feedback, motion)
        size = np.sqrt(np.sum(np.abs(new_motion) ** 2, axis=1, keepdims=True))
        step = np.sqrt(np.sum(np.abs(new_motion - motion) ** 2, axis=1, keepdims=True))
        relative_step = step / np.maximum(size, TINY)
        relaxation = np.where(
            relative_step > 0.9 * change, np.maximum(0.6 * relaxation, 0.1), relaxation
        )
        motion = motion + relaxation * (new_motion - motion)
        change = relative_step
        if np.all(relative_step < TOLERANCE):
            break
    demand = system.loop * motion + system.reference
    x, v, d = (
        samples_from_spectrum(grid, motion),
        samples_from_spectrum(grid, j_omega * motion),
        samples_from_spectrum(grid, demand),
    )
    actuator_spectrum = spectrum_from_samples(system.saturation(d, x, v))
    return Motion(
        motion,
        x,
        v,
        d,
        samples_from_spectrum(grid, system.drive * actuator_spectrum),
        change[:, 0],
        iterations,
    )


def _iterate(grid: Grid, system: System, feedback: Complexes, motion: Complexes) -> Complexes:
    """Return the next motion from the linear equivalents and remainders of a motion."""
    j_omega = 1j * grid.omega
    x, v = samples_from_spectrum(grid, motion), samples_from_spectrum(grid, j_omega * motion)
    passive_force = system.passive_force(x, v)
    damping = -_least_squares_factor(passive_force, v)
    stiffness = -_least_squares_factor(passive_force, x)
    remainder = spectrum_from_samples(passive_force + damping * v + stiffness * x)
    dynamic_stiffness = system.body + j_omega * damping + stiffness
    demand = samples_from_spectrum(grid, system.loop * motion + system.reference)
    actuator_force = system.saturation(demand, x, v)
    gain = _least_squares_factor(actuator_force, demand)
    actuator_remainder = spectrum_from_samples(actuator_force - gain * demand)
    force = system.excitation + system.drive * (gain * system.reference + actuator_remainder)
    return (force + remainder) / (dynamic_stiffness - gain * feedback)


def _least_squares_factor(record: Floats, basis: Floats) -> Floats:
    """Return the least-squares factor of ``record`` on ``basis``, row by row."""
    product = np.einsum("rn,rn->r", record, basis)
    square = np.einsum("rn,rn->r", basis, basis)
    factor: Floats = (product / np.maximum(square, TINY))[:, None]
    return factor


def _stiffness_at_rest(passive_force: PassiveForce, zeros: Floats) -> Floats:
    """Return the stiffness of the passive force at rest, N/m, row by row."""
    displacement = np.full(zeros.shape, 1e-6)
    stiffness = (passive_force(-displacement, zeros) - passive_force(displacement, zeros)) / (
        2.0 * displacement
    )
    mean: Floats = stiffness.mean(axis=1, keepdims=True)
    return mean
