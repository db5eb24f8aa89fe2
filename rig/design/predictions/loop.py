"""The control loop in the frequency domain: estimator, law, delay, hold and current loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controllers import estimator
from controllers.biquads import Biquad
from rig.design import impedance
from rig.design.predictions.grid import Complexes, Floats, Grid


class Timing(NamedTuple):
    """What of the loop is the same for all rows of an axis."""

    dt: float  # s, tick
    delay_ticks: int  # age of what the loop reads
    lag: float  # s, of the drive's current loop
    estimator: estimator.Params


class Law(NamedTuple):
    """Gains, one entry a row: F = Kp v + Ki x + Km a + Z_c v."""

    kp: Floats  # N*s/m
    ki: Floats  # N/m
    km: Floats  # kg
    sections: tuple[Biquad, ...]  # of Z_c, the same for all rows


class Estimated(NamedTuple):
    """What the estimator makes of a metre of the position it reads; by line."""

    position: Complexes
    velocity: Complexes  # 1/s
    acceleration: Complexes  # 1/s^2


def transition(dt: float) -> Floats:
    """The estimator's model over one tick: constant acceleration."""
    return np.array([[1.0, dt, 0.5 * dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])


def correction(params: estimator.Params) -> tuple[Floats, Floats]:
    """Gain G and I - G H of the estimator, which observes position alone."""
    gain = np.array([params.gain_position, params.gain_velocity, params.gain_acceleration])
    return gain, np.eye(3) - np.outer(gain, [1.0, 0.0, 0.0])


def estimated(timing: Timing, omega: Floats) -> Estimated:
    """Response of the estimator to the position that it reads, which is ``delay_ticks`` old."""
    gain, kept = correction(timing.estimator)
    closed = kept @ transition(timing.dt)
    back = np.exp(-1j * omega * timing.dt)
    system = np.eye(3) - back[:, None, None] * closed
    states = np.linalg.solve(system, np.broadcast_to(gain, (omega.size, 3))[..., None])[..., 0]
    return Estimated(states[:, 0], states[:, 1], states[:, 2])


def demand(timing: Timing, law: Law, omega: Floats) -> Complexes:
    """Force demanded per metre of true position, N/m; rows by lines."""
    seen = estimated(timing, omega)
    f_hz = omega / (2.0 * np.pi)
    added = impedance.response(law.sections, f_hz, timing.dt) * seen.velocity
    force = (
        law.kp[:, None] * seen.velocity
        + law.ki[:, None] * seen.position
        + law.km[:, None] * seen.acceleration
        + added
    )
    late = np.exp(-1j * omega * timing.dt * timing.delay_ticks)
    out: Complexes = force * late
    return out


def reference(on: Grid, periods: int, table: Sequence[float]) -> Complexes:
    """The lines of an open-loop force that repeats ``periods`` times, one value a tick; N.

    Lines beyond the grid's are left out: half its rate of 32 Hz or more.
    """
    found = np.zeros(on.samples // 2 + 1, dtype=np.complex128)
    if not table:
        return found
    values = np.fft.rfft(np.asarray(table, dtype=np.float64)) * (on.samples / len(table))
    count = min(values.size, on.samples // 2 // periods + 1)
    found[: count * periods : periods] = values[:count]
    return found


def drive(timing: Timing, omega: Floats) -> Complexes:
    """Motor force per force commanded: held for a tick, then through the current loop."""
    half = 0.5 * omega * timing.dt
    held = np.sinc(half / np.pi) * np.exp(-1j * half)
    out: Complexes = held / (1.0 + 1j * omega * timing.lag)
    return out
