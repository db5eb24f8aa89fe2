"""One axis of a floating body: hull, waves and control loop, and its steady motion."""

from typing import NamedTuple

import numpy as np

from rig.design import loop
from rig.design.grid import Complexes, Floats, Grid
from rig.design.steady_motion import Motion, PassiveForce, Saturation, System, solve_steady_motion


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
    timing: loop.Timing
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
    law: loop.Law,
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
            loop.demand_response(axis.timing, law, omega),
            open_loop_force,
            loop.drive_response(axis.timing, omega),
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
