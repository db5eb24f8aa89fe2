"""The periodic motion of one axis: equivalent linearisation, then its remainder as a force.

    D(jw) X = F_exc + F_passive(x, v) + A(jw) granted(L(jw) X + R)

D is the linear body, L the loop from true position to the force it demands, R an open-loop force
beside it, A the drive from granted to motor force. What is not linear is written over the record
of one period as

    F_passive = -B v - K x + r,     granted(d) = g d + q

with B, K and g the least-squares equivalents over that very record (for a sine 8/(3 pi) c V and so
on, for many waves the Gaussian moments, for a given sea neither but its own). The linear problem
with B, K, g is solved line by line, r and q are put back as forces, and both are repeated until
the motion stands still: equivalent linearisation alone would stop at r = q = 0.

Sources: Roberts and Spanos, Random Vibration and Statistical Linearization, ch. 4 and 5; Folley
and Whittaker 2010 (Coastal Engineering 57, 892) for wave energy converters; Cameron and Griffin
1989 (J. Appl. Mech. 56, 149) for the remainder, evaluated in time and balanced in frequency.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from rig.design.predictions.grid import Complexes, Floats, Grid, record, spectrum

Passive = Callable[[Floats, Floats], Floats]
"""Force (N) of positions (m) and velocities (m/s), rows by samples."""

Granted = Callable[[Floats, Floats, Floats], Floats]
"""Force granted (N) of demands (N), positions and velocities, rows by samples."""

CLOSE = 1e-4  # of the motion's rms: what one more round changes at most
SETTLED = 0.01  # of it: what the last round may still change of a motion that counts as found
MOST_ROUNDS = 60
TINY = 1e-30
# N*s/m on top of what is linear, in the motion that the rounds begin with: friction and drag are
# not known before there is a motion, and without any damping one near a resonance would be endless.
# What the rounds end with does not depend on it.
FIRST_DAMPING = 500.0


class System(NamedTuple):
    """Rows of one axis, all in the same sea."""

    body: Complexes  # D, N/m: rows by lines
    excitation: Complexes  # N: lines
    loop: Complexes  # L, N per metre of true position: rows by lines
    reference: Complexes  # R, N: rows by lines
    drive: Complexes  # A: lines
    passive: Passive
    granted: Granted | None = None  # None: everything is


class Motion(NamedTuple):
    """Periodic motion of every row, rows by samples."""

    lines: Complexes  # of the position
    position: Floats  # m
    velocity: Floats  # m/s
    demand: Floats  # N, before limits
    motor: Floats  # N, on the body
    change: Floats  # of the motion's rms in the last round, by row
    rounds: int


def steady(on: Grid, system: System) -> Motion:
    """The motion that repeats with the sea, for every row."""
    rows = system.loop.shape[0]
    turn = 1j * on.omega
    still = np.zeros((rows, on.samples))
    if not (np.any(system.excitation) or np.any(system.reference)):
        none = np.zeros((rows, on.omega.size), dtype=np.complex128)
        return Motion(none, still, still, still, still, np.zeros(rows), 0)
    straight = system.drive * system.loop
    slope = _slope(system.passive, still)
    pushed = system.excitation + system.drive * system.reference
    motion = pushed / (system.body + turn * FIRST_DAMPING + slope - straight)
    relaxed = np.ones((rows, 1))
    change = np.full((rows, 1), np.inf)
    rounds = 0
    while rounds < MOST_ROUNDS:
        rounds += 1
        after = _round(on, system, straight, motion)
        size = np.sqrt(np.sum(np.abs(after) ** 2, axis=1, keepdims=True))
        step = np.sqrt(np.sum(np.abs(after - motion) ** 2, axis=1, keepdims=True))
        moved = step / np.maximum(size, TINY)
        relaxed = np.where(moved > 0.9 * change, np.maximum(0.6 * relaxed, 0.1), relaxed)
        motion = motion + relaxed * (after - motion)
        change = moved
        if np.all(moved < CLOSE):
            break
    demand = system.loop * motion + system.reference
    x, v, d = record(on, motion), record(on, turn * motion), record(on, demand)
    granted = d if system.granted is None else system.granted(d, x, v)
    lines = demand if system.granted is None else spectrum(granted)
    return Motion(motion, x, v, d, record(on, system.drive * lines), change[:, 0], rounds)


def _round(on: Grid, system: System, straight: Complexes, motion: Complexes) -> Complexes:
    """One round: equivalents and remainders of a motion, and the motion they give."""
    turn = 1j * on.omega
    x, v = record(on, motion), record(on, turn * motion)
    force = system.passive(x, v)
    damping = -_share(force, v)
    stiffness = -_share(force, x)
    rest = spectrum(force + damping * v + stiffness * x)
    whole = system.body + turn * damping + stiffness
    if system.granted is None:
        pushed = system.excitation + system.drive * system.reference
        return (pushed + rest) / (whole - straight)
    demand = record(on, system.loop * motion + system.reference)
    granted = system.granted(demand, x, v)
    gain = _share(granted, demand)
    left = spectrum(granted - gain * demand)
    pushed = system.excitation + system.drive * (gain * system.reference + left)
    return (pushed + rest) / (whole - gain * straight)


def _share(of: Floats, along: Floats) -> Floats:
    """The least-squares factor of one record along another, row by row."""
    product = np.einsum("rn,rn->r", of, along)
    square = np.einsum("rn,rn->r", along, along)
    share: Floats = (product / np.maximum(square, TINY))[:, None]
    return share


def _slope(passive: Passive, still: Floats) -> Floats:
    """Stiffness of the passive force at rest, N/m, row by row."""
    near = np.full(still.shape, 1e-6)
    slope = (passive(-near, still) - passive(near, still)) / (2.0 * near)
    mean: Floats = slope.mean(axis=1, keepdims=True)
    return mean
