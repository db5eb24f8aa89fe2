"""Trends between set points, and the position correction that follows from them.

Figures 2.4 and 2.5 and equation 2.6 of the OSWEC thesis. The thesis relates the phase shift to the
motor's velocity; a compliance delays by torque per velocity, so the delay over rms torque is
fitted, too.
"""

from typing import NamedTuple

import numpy as np

from rig.kinds.oswec_bench.products.deflection import Motion, ShaftLag
from rig.kinds.oswec_bench.products.estimate import Floats, Line, fit_line, value_at


class Regressions(NamedTuple):
    """Lines through the means of the set points."""

    amplitude: Line  # amplitude difference, rad, over rms torque, N*m
    velocity_phase: Line  # phase shift, share of the period, over rms motor velocity, rad/s
    torque_phase: Line  # phase shift, share of the period, over rms torque, N*m


class Correction(NamedTuple):
    """Amplitude and advance: removed from a motor's sine to predict the shaft, or added to a
    command.
    """

    amplitude: float  # rad
    advance: float  # share of the period


def fit_regressions(points: list[ShaftLag]) -> Regressions:
    """Return the three trends over at least three set points; ValueError for fewer."""
    torque = [each.rms_torque for each in points]
    phase = [float(each.phase_shift.mean()) for each in points]
    amplitude = [float(each.amplitude_difference.mean()) for each in points]
    if len(points) < 3:
        raise ValueError(f"{len(points)} set points; regressions need at least 3")
    return Regressions(
        fit_line(torque, amplitude),
        fit_line([each.rms_velocity for each in points], phase),
        fit_line(torque, phase),
    )


def explained_variance(points: list[ShaftLag]) -> float:
    """Return R^2 of the phase shift over 1/v and T/v: the joint effect of gap and compliance.

    Each term is a deflection over a velocity. Velocity alone (Fig. 2.4) leaves out the torque,
    which differs fourfold between dampings at one velocity.
    """
    v = np.array([each.rms_velocity for each in points])
    torque = np.array([each.rms_torque for each in points])
    phase = np.array([float(each.phase_shift.mean()) for each in points])
    design = np.stack([1.0 / v, torque / v, np.ones(len(v))], axis=1)
    residual = phase - design @ np.linalg.lstsq(design, phase, rcond=None)[0]
    return 1.0 - float((residual * residual).sum() / ((phase - phase.mean()) ** 2).sum())


def leave_one_out(points: list[ShaftLag], left_out: int) -> Regressions:
    """Return the trends of all set points but one, for rating that one."""
    return fit_regressions([each for i, each in enumerate(points) if i != left_out])


def predict_correction(
    regressions: Regressions, point: ShaftLag, *, delay_over_torque: bool = False
) -> Correction:
    """Return the correction of a set point by its rms velocity and torque.

    ``delay_over_torque`` uses the delay over torque instead of the thesis's phase over velocity.
    """
    advance = (
        value_at(regressions.torque_phase, point.rms_torque)
        if delay_over_torque
        else value_at(regressions.velocity_phase, point.rms_velocity)
    )
    return Correction(float(value_at(regressions.amplitude, point.rms_torque)), float(advance))


def correct_offline(motion: Motion, correction: Correction, amplitude: float) -> Floats:
    """Return the motor's motion corrected towards the shaft's, rad: equation 2.6 of the thesis.

    Theta = (1 - dA / A) FFT(theta_m) exp(-i omega phi), transformed back; ``amplitude`` A in rad.
    """
    spectrum = np.fft.rfft(motion.motor)
    omega = 2.0 * np.pi * np.fft.rfftfreq(len(motion.motor), motion.cut.dt)
    spectrum *= (1.0 - correction.amplitude / amplitude) * np.exp(
        -1j * omega * correction.advance * motion.cut.period
    )
    return np.fft.irfft(spectrum, len(motion.motor))
