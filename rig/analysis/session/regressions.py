"""Trends between set points, and the position correction that is made of them.

Figures 2.4 and 2.5 and equation 2.6 of the OSWEC thesis. The thesis puts the phase shift down to
the motor's velocity; a delay that grows with the torque per velocity is the compliance's own law,
so the delay over rms torque stands beside it.
"""

from typing import NamedTuple

import numpy as np

from rig.analysis.session.deflection import Behind, Motion
from rig.analysis.session.estimate import Floats
from rig.analysis.session.linear_fit import Line, at, line


class Regressions(NamedTuple):
    """Lines through the means of the set points."""

    amplitude: Line  # amplitude difference, rad, over rms torque, N*m
    phase: Line  # phase shift, share of the period, over rms motor velocity, rad/s
    delay: Line  # phase shift, share of the period, over rms torque, N*m


class Correction(NamedTuple):
    """What is taken from a motor's sine to have the shaft's, or added to a command's."""

    amplitude: float  # rad
    advance: float  # share of the period


def regress(points: list[Behind]) -> Regressions:
    """The three trends over at least three set points; ValueError for fewer."""
    torque = [each.rms_torque for each in points]
    phase = [float(each.phase_shift.mean()) for each in points]
    amplitude = [float(each.amplitude_difference.mean()) for each in points]
    if len(points) < 3:
        raise ValueError(f"{len(points)} set points; regressions need at least 3")
    return Regressions(
        line(torque, amplitude),
        line([each.rms_velocity for each in points], phase),
        line(torque, phase),
    )


def explained(points: list[Behind]) -> float:
    """R^2 of the phase shift over 1/v and T/v: what gap and compliance make of it together.

    Either is a deflection over a velocity. Velocity alone (Fig. 2.4) leaves out the torque, which
    differs fourfold between dampings at one velocity.
    """
    v = np.array([each.rms_velocity for each in points])
    torque = np.array([each.rms_torque for each in points])
    phase = np.array([float(each.phase_shift.mean()) for each in points])
    design = np.stack([1.0 / v, torque / v, np.ones(len(v))], axis=1)
    rest = phase - design @ np.linalg.lstsq(design, phase, rcond=None)[0]
    return 1.0 - float((rest * rest).sum() / ((phase - phase.mean()) ** 2).sum())


def without(points: list[Behind], left_out: int) -> Regressions:
    """The trends of all set points but one, by which that one may be judged."""
    return regress([each for i, each in enumerate(points) if i != left_out])


def predicted(known: Regressions, point: Behind, *, by_torque: bool = False) -> Correction:
    """The correction of a set point by its rms velocity and torque.

    ``by_torque`` takes the delay over torque in place of the thesis's phase over velocity.
    """
    advance = (
        at(known.delay, point.rms_torque) if by_torque else at(known.phase, point.rms_velocity)
    )
    return Correction(float(at(known.amplitude, point.rms_torque)), float(advance))


def offline(of: Motion, by: Correction, amplitude: float) -> Floats:
    """The motor's motion corrected towards the shaft's, rad: equation 2.6 of the thesis.

    Theta = (1 - dA / A) FFT(theta_m) exp(-i omega phi), transformed back; ``amplitude`` A in rad.
    """
    spectrum = np.fft.rfft(of.motor)
    omega = 2.0 * np.pi * np.fft.rfftfreq(len(of.motor), of.of.dt)
    spectrum *= (1.0 - by.amplitude / amplitude) * np.exp(-1j * omega * by.advance * of.of.period)
    return np.fft.irfft(spectrum, len(of.motor))
