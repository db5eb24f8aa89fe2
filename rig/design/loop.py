"""The control loop in the frequency domain: estimator, law, delay, hold and current loop."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controllers import estimator
from controllers.biquads import Biquad
from rig.design import impedance
from rig.design.estimator import response
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


def demand_response(timing: Timing, law: Law, omega: Floats) -> Complexes:
    """Return the demanded force per metre of true position, N/m; rows by lines."""
    estimate = response(timing.estimator, omega, timing.dt)
    f_hz = omega / (2.0 * np.pi)
    zc_force = impedance.response(law.sections, f_hz, timing.dt) * estimate.velocity
    force = (
        law.kp[:, None] * estimate.velocity
        + law.ki[:, None] * estimate.position
        + law.km[:, None] * estimate.acceleration
        + zc_force
    )
    delay = np.exp(-1j * omega * timing.dt * timing.delay_ticks)
    delayed: Complexes = force * delay
    return delayed


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
    motor_force: Complexes = hold / (1.0 + 1j * omega * timing.lag)
    return motor_force
