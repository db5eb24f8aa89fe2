"""One axis of a floating body: hull, waves and its steady motion; in the frequency domain its
control loop of estimator, law, delay, hold and current loop.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from controllers import estimator
from controllers.biquads import Biquad
from rig.design import impedance
from rig.design.estimator import response
from rig.design.grid import Complexes, Floats, Grid
from rig.design.steady_motion import Motion, PassiveForce, Saturation, System, solve_steady_motion


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


class Body(NamedTuple):
    """One axis about rest; radiation is (b4 s4 + .. + b1 s)/(s5 + a4 s4 + .. + a0)."""

    inertia: float  # kg, including the added mass at infinite frequency
    damping: float  # N*s/m
    stiffness: float  # N/m
    radiation_a: tuple[float, ...]  # a0 .. a4
    radiation_b: tuple[float, ...]  # b1 .. b4


class Axis(NamedTuple):
    """Parameters of one axis that do not depend on the gains."""

    body: Body  # with the linear damping of the drivetrain
    quadratic: float  # N s2/m2, drag
    excitation: Complexes  # N, by line
    timing: Timing
    newtons_per_ampere: float
    current_limit: float  # A, peak


def dynamic_stiffness(body: Body, omega: Floats) -> Complexes:
    """Return the force per position, N/m, at ``omega`` (rad/s); amplitudes of e^{+i omega t}."""
    s = np.asarray(1j * omega, dtype=np.complex128)
    num, den = [*reversed(body.radiation_b), 0.0], [1.0, *reversed(body.radiation_a)]
    damping = np.polyval(num, s) / np.polyval(den, s) + body.damping
    return np.asarray(s * s * body.inertia + s * damping + body.stiffness, dtype=np.complex128)


def drag_force(quadratic: float, v: Floats) -> Floats:
    """Return the force of quadratic drag on the body, N."""
    return -quadratic * np.abs(v) * v


def solve_axis(
    grid: Grid,
    axis: Axis,
    law: Law,
    open_loop_force: Complexes,
    passive_force: PassiveForce,
    saturation: Saturation,
) -> Motion:
    """Return the motion of an axis that repeats with the sea, one row per setting of ``law``.

    ``open_loop_force`` (N, rows by lines) is added to the law's demand; ``passive_force`` is the
    nonlinear force of everything but drag and drive.
    """
    omega = grid.omega
    return solve_steady_motion(
        grid,
        System(
            dynamic_stiffness(axis.body, omega)[None, :],
            axis.excitation,
            demand_response(axis.timing, law, omega),
            open_loop_force,
            drive_response(axis.timing, omega),
            lambda x, v: passive_force(x, v) + drag_force(axis.quadratic, v),
            saturation,
        ),
    )


def peak(values: Floats) -> Floats:
    """Return the largest magnitude in each row."""
    peaks: Floats = np.abs(values).max(axis=1)
    return peaks


def rms(values: Floats) -> Floats:
    """Return the root mean square of each row."""
    result: Floats = np.sqrt(np.mean(values * values, axis=1))
    return result


def moving_rms_peak(sample_period: float, values: Floats, time_constant: float) -> Floats:
    """Return the largest moving rms of each row, a periodic record: that of a first-order filter.

    ``sample_period`` and ``time_constant`` are in s.
    """
    spectrum = np.fft.rfft(values * values, axis=-1)
    omega = 2.0 * np.pi * np.fft.rfftfreq(values.shape[-1], sample_period)
    averaged = np.fft.irfft(
        spectrum / (1.0 + 1j * omega * time_constant), values.shape[-1], axis=-1
    )
    peaks: Floats = np.sqrt(np.maximum(averaged.max(axis=-1), 0.0))
    return peaks
