"""How far the shaft stays behind the motor at one set point: deflection, phase shift, amplitude.

The quantities of figure 2.2 of the OSWEC thesis, from measured encoder angles at the gearbox
output (rad) and the load cell's torque (N*m).
"""

from typing import NamedTuple

import numpy as np
from scipy.ndimage import minimum_filter1d

from rig.analysis.session import periods
from rig.analysis.session.estimate import Floats
from rig.analysis.session.periods import Cut

WINDOW = 0.015  # s, of the moving-window differentiator
LEVEL = 95.0  # percentile by which a deflection is judged


class Motion(NamedTuple):
    """A set point cut to its whole periods, drift and mean taken out of the angles."""

    of: Cut
    motor: Floats  # rad
    shaft: Floats  # rad
    torque: Floats  # N*m, positive as the motor's on the brake

    @property
    def deflection(self) -> Floats:
        """Motor minus shaft, rad."""
        return self.motor - self.shaft


class Behind(NamedTuple):
    """What a set point says of the driveline; arrays by period."""

    phase_shift: Floats  # share of the period by which the shaft comes later
    amplitude_difference: Floats  # rad, half stroke of the motor less that of the shaft
    amplitude: float  # rad, of the motor
    rms_velocity: float  # rad/s, of the motor
    rms_torque: float  # N*m
    deflection_mean: float  # rad, of the magnitude
    deflection_low: float  # rad, its 5th percentile
    deflection_high: float  # rad, its 95th


def motion(motor: Floats, shaft: Floats, torque: Floats, of: Cut) -> Motion:
    """Signals as measured, (samples,), made ready for the rest of this room."""
    return Motion(
        of,
        periods.detrended(motor, of),
        periods.detrended(shaft, of),
        torque[of.edges[0] : of.edges[-1]],
    )


def behind(of: Motion) -> Behind:
    """Phase shift by the fundamentals, amplitude difference by the peaks, period by period."""
    motor, shaft = (periods.fundamentals(each, of.of) for each in (of.motor, of.shaft))
    strokes = [periods.half_strokes(each, of.of) for each in (of.motor, of.shaft)]
    size = np.abs(of.deflection)
    low, high = np.percentile(size, [100.0 - LEVEL, LEVEL])
    speed = periods.velocity(of.motor, of.of.dt, WINDOW)
    return Behind(
        np.angle(motor * np.conj(shaft)) / (2.0 * np.pi),
        strokes[0] - strokes[1],
        float(strokes[0].mean()),
        periods.rms(speed),
        periods.rms(of.torque),
        float(size.mean()),
        float(low),
        float(high),
    )


def judged(error: Floats) -> float:
    """The 95th percentile of the magnitude of a position error, rad."""
    return float(np.percentile(np.abs(error), LEVEL))


def pooled(errors: list[Floats]) -> float:
    """The same over all samples of several set points."""
    return judged(np.concatenate(errors))


def engaged(of: Motion) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Samples at which the teeth are in contact and the shaft moves against its load.

    Behind a reversal the shaft rests until the gap is crossed; what the load cell reads there is
    not what turns the driveline.
    """
    speed = periods.velocity(of.shaft, of.of.dt, WINDOW)
    moving = (np.abs(speed) > 0.15 * np.abs(speed).max()) & (speed * of.torque > 0.0)
    around = 2 * round(WINDOW / of.of.dt) + 1  # the window sees a start before it happens
    out: np.ndarray[tuple[int], np.dtype[np.bool_]] = minimum_filter1d(moving, around)
    return out
