"""The control loop in the frequency domain: estimator, law, delay, hold and current loop."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controllers import estimator
from controllers.biquads import Biquad
from rig.design import impedance
from rig.design.grid import Complexes, Floats, Grid


class Timing(NamedTuple):
    """Loop parameters that all rows of an axis share."""

    dt: float  # s, tick
    delay_ticks: int  # age of the sensor values that the loop reads
    lag: float  # s, of the drive's current loop
    estimator: estimator.Params


class Law(NamedTuple):
    """Gains, one entry per row: F = Kp v + Ki x + Km a + Z_c v."""

    kp: Floats  # N*s/m
    ki: Floats  # N/m
    km: Floats  # kg
    sections: tuple[Biquad, ...]  # of Z_c, shared by all rows


class EstimatorResponse(NamedTuple):
    """Estimates per metre of the measured position, by line."""

    position: Complexes
    velocity: Complexes  # 1/s
    acceleration: Complexes  # 1/s^2


def transition(dt: float) -> Floats:
    """Return the estimator's transition matrix over one tick: constant acceleration."""
    return np.array([[1.0, dt, 0.5 * dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])


def correction(params: estimator.Params) -> tuple[Floats, Floats]:
    """Return gain G and matrix I - G H of the estimator, which measures position only."""
    gain = np.array([params.gain_position, params.gain_velocity, params.gain_acceleration])
    return gain, np.eye(3) - np.outer(gain, [1.0, 0.0, 0.0])


def estimator_response(timing: Timing, omega: Floats) -> EstimatorResponse:
    """Return the response of the estimator to its measured position (already delayed)."""
    gain, correction_matrix = correction(timing.estimator)
    error_dynamics = correction_matrix @ transition(timing.dt)
    z_inv = np.exp(-1j * omega * timing.dt)
    system = np.eye(3) - z_inv[:, None, None] * error_dynamics
    states = np.linalg.solve(system, np.broadcast_to(gain, (omega.size, 3))[..., None])[..., 0]
    return EstimatorResponse(states[:, 0], states[:, 1], states[:, 2])


def demand_response(timing: Timing, law: Law, omega: Floats) -> Complexes:
    """Return the demanded force per metre of true position, N/m; rows by lines."""
    estimate = estimator_response(timing, omega)
    f_hz = omega / (2.0 * np.pi)
    zc_force = impedance.response(law.sections, f_hz, timing.dt) * estimate.velocity
    force = (
        law.kp[:, None] * estimate.velocity
        + law.ki[:, None] * estimate.position
        + law.km[:, None] * estimate.acceleration
        + zc_force
    )
    delay = np.exp(-1j * omega * timing.dt * timing.delay_ticks)
    response: Complexes = force * delay
    return response


def reference_spectrum(grid: Grid, repeats: int, table: Sequence[float]) -> Complexes:
    """Return the spectrum of an open-loop force that repeats ``repeats`` times per period, N.

    ``table`` has one value per tick. Lines above the grid's highest frequency (half its rate of
    32 Hz or more) are omitted.
    """
    spectrum = np.zeros(grid.samples // 2 + 1, dtype=np.complex128)
    if not table:
        return spectrum
    values = np.fft.rfft(np.asarray(table, dtype=np.float64)) * (grid.samples / len(table))
    count = min(values.size, grid.samples // 2 // repeats + 1)
    spectrum[: count * repeats : repeats] = values[:count]
    return spectrum


def drive_response(timing: Timing, omega: Floats) -> Complexes:
    """Return motor force per commanded force: zero-order hold over a tick, then current loop."""
    half_angle = 0.5 * omega * timing.dt
    hold = np.sinc(half_angle / np.pi) * np.exp(-1j * half_angle)
    response: Complexes = hold / (1.0 + 1j * omega * timing.lag)
    return response
